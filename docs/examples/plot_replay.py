"""
Watch the trials that went wrong
================================

Record what a policy does in some trials, pick those that ended in contact, and replay them next
to the oracle, which shows how they could have ended.
"""

# sphinx_gallery_thumbnail_path = '_static/replay.png'

# %%
# Record
# ------
# A :py:class:`~kinarm.Recording` holds the states that the simulator went through.

from kinarm.evaluation import TrialSet, find_contestants, oracle_bounds, record
from kinarm.viewer import replay_page

trials = TrialSet.draw("right", trials=200, seed=0)
bounds = oracle_bounds(trials)
(policy,) = find_contestants("ars-tuned-both-seed0")
(oracle,) = find_contestants("oracle")
recordings = record(policy, trials, bounds=bounds)
collided = [each for each in recordings if each.outcome == "collision"]
for each in collided:
    print(f"trial {each.trial}: {' touches '.join(each.contact)} after {each.steps} steps")

# %%
# Replay
# ------
# The page shows itself here as in a notebook; ``replay_page(..., "contacts.html")`` writes it to
# a file. The blue ghost is the oracle in the same trial.

chosen = sorted(collided, key=lambda each: -each.steps)[:4]
ghosts = record(oracle, trials, [each.trial for each in chosen], bounds=bounds)
replay_page(chosen, ghosts=ghosts)
