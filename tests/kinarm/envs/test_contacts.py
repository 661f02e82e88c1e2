"""Numbers of what a refused move touches."""

import numpy as np
import pytest

from kinarm.envs.infos import Contacts
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator


@pytest.fixture(scope="module")
def refused():
    """Steps of many arms, some of which are refused; the simulator, its episodes and results."""
    simulator = Simulator(PROBLEMS["both"], threads=1)
    rng = np.random.default_rng(4)
    episodes = simulator.reset(*simulator.sample(rng, 400))
    while True:
        starts = episodes.q.copy()
        result = simulator.step(episodes, rng.uniform(-1, 1, (400, simulator.n_actions)))
        if np.count_nonzero(result.collision) >= 5:
            return simulator, starts, episodes, result


def test_numbers_are_those_of_the_pairs_that_touch_first(refused):
    simulator, starts, episodes, result = refused
    contacts = Contacts(simulator.world)
    contacts.find(episodes, result)
    for row in np.flatnonzero(result.collision):
        touching = simulator.world.contact_pair(starts[row], episodes.target[row])
        assert contacts.names[result.contact[row]] == touching is not None
    assert not result.contact[~result.collision].any()


def test_a_number_that_got_lost_is_found_again(refused):
    simulator, _, episodes, result = refused
    contacts = Contacts(simulator.world)
    contacts.find(episodes, result)
    known = result.contact.copy()
    result.contact[result.collision] = 0
    episodes.doubt[result.collision] = 2**simulator.world.rules.tested - 1
    contacts.find(episodes, result)
    np.testing.assert_array_equal(result.contact, known)


def test_what_no_bit_calls_doubtful_touches_nothing(refused):
    simulator, _, episodes, result = refused
    row = int(np.flatnonzero(result.collision)[0])
    result.contact[row], episodes.doubt[row] = 0, 0
    Contacts(simulator.world).find(episodes, result)
    assert result.contact[row] == 0
