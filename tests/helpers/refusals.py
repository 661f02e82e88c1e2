"""What a command line answers to bad input."""


def check_refused(answer, *words: str) -> None:
    """One line that names what is wrong, and status 2."""
    assert answer.status == 2, answer
    assert answer.out == ""
    assert answer.err.endswith("\n")
    assert len(answer.err.splitlines()) == 1, answer.err
    assert answer.err.startswith("kinarm-")
    for word in words:
        assert word in answer.err, answer.err
