"""
A score next to its bound
=========================

The oracle solves random trials: the steps of the motions that it finds, against the number of
steps that it proves to be necessary. A trained policy in the same trials takes several times as
long.
"""

# %%
# Bounds of a trial set
# ---------------------
# :py:class:`~kinarm.evaluation.TrialSet` draws starts and goals, and
# :py:func:`~kinarm.evaluation.oracle_bounds` solves them: for every trial a motion that reaches
# the goal, and a number of steps below which no policy can.

import matplotlib.pyplot as plt
import numpy as np

from kinarm import Simulator
from kinarm.evaluation import TrialSet, evaluate, oracle_bounds

trials = TrialSet.draw(Simulator("paper", "both"), trials=400, seed=3)
bounds = oracle_bounds(trials)
gap = (bounds.steps - bounds.steps_lower_bound)[bounds.reachable]
print(f"a motion was found in {100 * bounds.reachable.mean():.1f} % of the trials")
print(f"it takes as many steps as are necessary in {100 * (gap == 0).mean():.1f} % of these")
print(f"the proof is complete in {100 * bounds.tight.mean():.1f} %")

# %%
# Found against proven
# --------------------
# A point on the diagonal is a motion than which none is faster. Below it nothing can lie.
# The policy is a trained linear one; only trials that it solves are shown.

policy = evaluate("ars-tuned-both", trials=400, seed=3, oracle=True)
oracle = evaluate("oracle", task="both", trials=400, seed=3, oracle=True)
solved = policy.rollouts.success

figure, panels = plt.subplots(1, 2, figsize=(9.2, 4.4), layout="constrained")
jitter = np.random.default_rng(0).uniform(-0.3, 0.3, (2, len(trials)))
for which, steps, colour, name in (
    (solved, policy.rollouts.steps, "#d55e00", "trained policy"),
    (oracle.rollouts.success, oracle.rollouts.steps, "#0072b2", "oracle"),
):
    across, up = bounds.steps_lower_bound + jitter[0], steps + jitter[1]
    panels[0].plot(across[which], up[which], ".", color=colour, markersize=4, label=name)
panels[0].plot([0, 64], [0, 64], color="#444444", linewidth=1)
panels[0].text(50, 47, "impossible below", rotation=45, ha="center", va="top", color="#444444")
panels[0].set(
    xlabel="steps proven necessary",
    ylabel="steps taken",
    xlim=(0, 65),
    ylim=(0, 65),
    aspect="equal",
)
panels[0].legend(frameon=False, loc="lower right")

# %%
# The step ratio
# --------------
# Steps taken over steps proven necessary, of the trials that were solved.

for ratio, colour, name in (
    (policy.step_ratio, "#d55e00", "trained policy"),
    (oracle.step_ratio, "#0072b2", "oracle"),
):
    share = np.arange(1, len(ratio) + 1) / len(trials)
    panels[1].step(np.sort(ratio), share, where="post", color=colour, label=name)
    print(f"{name}: median {np.median(ratio):.2f}, 95th percentile {np.percentile(ratio, 95):.2f}")
panels[1].set(xlabel="step ratio", ylabel="share of trials solved", xscale="log", ylim=(0, 1.02))
panels[1].set_xticks([1, 2, 4, 8, 16], ["1", "2", "4", "8", "16"])
panels[1].legend(frameon=False, loc="lower right")
for axes in panels:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.3)
plt.show()
