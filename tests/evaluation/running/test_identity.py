"""Workers must be of the same kinarm."""

import pytest

from kinarm.errors import WorkerError
from kinarm.evaluation.running.identity import Guarded, check_identity, identity, source_digest


def test_the_same_here():
    check_identity(identity())
    assert Guarded(len, identity())("four") == 4


def test_it_is_found_out_once():
    assert identity.__wrapped__() == identity()
    assert identity() is identity()


def test_everything_that_results_depend_on_is_told():
    names = {name for name, _ in identity()}
    assert {"python", "numpy", "numba", "coal", "pin", "semantics", "source of kinarm"} <= names


@pytest.mark.parametrize("name", ["semantics", "source of kinarm", "a package"])
def test_a_difference_is_named(name):
    expected = tuple((key, value) for key, value in identity() if key != name)
    with pytest.raises(WorkerError, match=f"{name} is .* there, another here"):
        Guarded(len, (*expected, (name, "another")))("four")


def test_the_hash_covers_all_packages(monkeypatch):
    before = source_digest()
    monkeypatch.setattr("kinarm.evaluation.running.identity.BESIDE", ("policies",))
    assert source_digest() != before
