"""``kinarm-replay --failures``: all failures, grouped by cause."""

from collections import Counter

from documents import outcomes_of
from refusals import check_refused

from kinarm.recording import load_recordings


def test_all_failures_in_groups_beside_the_oracle(replay, evaluation, policy_folder, tmp_path):
    said = outcomes_of(evaluation, "random")
    kinds = zip(said["outcome"], said["contact"], said["steps"], strict=True)
    expected = {
        number: "truncated"
        if contact is None
        else f"{' touches '.join(contact)} {'within' if steps <= 3 else 'after'} 3 steps"
        for number, (outcome, contact, steps) in enumerate(kinds)
        if outcome != "success"
    }
    kept = tmp_path / "kept.npz"
    options = ("--problem", "right", "--trials", 12, "--seed", 4, "--record", kept)
    answer = replay("--policy", "random", "--failures", *options)
    first, *lines, last = answer.out.splitlines()
    assert first == f"random: {len(expected)} of 12 trials of right failed"
    counts = {line[7:]: int(line[:5]) for line in lines}
    assert counts == dict(Counter(expected.values()))
    assert list(counts.values()) == sorted(counts.values(), reverse=True)
    assert "written" in last
    recorded = load_recordings(kept)
    played, ghosts = (
        [each for each in recorded if (each.policy == "oracle") == ghost] for ghost in (False, True)
    )
    assert [each.trial for each in played] == [each.trial for each in ghosts]
    assert sorted(each.trial for each in played) == sorted(expected)
    ranks = [list(counts).index(expected[each.trial]) for each in played]
    assert ranks == sorted(ranks)
    for one, ghost in zip(played, ghosts, strict=True):
        assert one.same_trial(ghost)
        assert one.steps_lower_bound <= ghost.steps
    assert {each.outcome for each in ghosts} == {"success"}


def test_failures_of_recordings(replay, recordings):
    kept = load_recordings(recordings)
    missed = sum(each.outcome != "success" for each in kept)
    answer = replay(recordings, "--failures")
    if missed:
        assert f"{missed} of {len(kept)} trials of right failed" in answer.out
    else:
        check_refused(answer, "none of the 4 trials failed")
