"""A few of the command lines of `tests.campaign.command_lines`."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from .command_lines import PROGRAMS, CommandJudge, command_lines, drawn_line, inside
from .running import generator

DRAWN, MADE = 20, 8


@pytest.mark.parametrize("name", PROGRAMS)
def test_every_drawn_command_line_ends_well(name, tmp_path):
    with inside(tmp_path), CommandJudge(name) as judge:
        lines = [drawn_line(name, generator(1, name, number)) for number in range(DRAWN)]
        found = {" ".join(line)[:200]: judge(line).finding for line in lines}
    assert {line: finding for line, finding in found.items() if finding} == {}


@pytest.mark.parametrize("name", PROGRAMS)
@settings(max_examples=MADE, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_every_command_line_that_hypothesis_makes_ends_well(name, data, tmp_path_factory):
    line = data.draw(command_lines(name))
    with inside(tmp_path_factory.mktemp("lines")), CommandJudge(name) as judge:
        assert judge(line).finding == ""
