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

from kinarm.evaluation import TrialSet, evaluate, oracle_bounds

trials = TrialSet.draw("both", trials=400, seed=3)
bounds = oracle_bounds(trials)
gap = (bounds.steps - bounds.steps_lower_bound)[bounds.reachable]
print(f"a motion was found in {100 * bounds.reachable.mean():.1f} % of the trials")
print(f"it takes as many steps as are necessary in {100 * (gap == 0).mean():.1f} % of these")
print(f"the proof is complete in {100 * bounds.proof_complete.mean():.1f} %")

# %%
# Found against proven
# --------------------
# A point on the diagonal is a fastest motion. No point can lie below it.
# The policy is a trained linear one. The figure shows only trials that it solves.

policy = evaluate("ars-tuned-both", trials=400, seed=3, oracle=True)
oracle = evaluate("oracle", "both", trials=400, seed=3, oracle=True)
solved = policy.rollouts.success

figure, axes = plt.subplots(figsize=(5.2, 5.0), layout="constrained")
jitter = np.random.default_rng(0).uniform(-0.35, 0.35, len(trials))  # the same across and up
for which, steps, colour, name in (
    (solved, policy.rollouts.steps, "#d55e00", "trained policy"),
    (oracle.rollouts.success, oracle.rollouts.steps, "#0072b2", "oracle"),
):
    across, up = bounds.steps_lower_bound + jitter, steps + jitter
    axes.plot(across[which], up[which], ".", color=colour, markersize=4, label=name)
axes.plot([0, 65], [0, 65], color="#444444", linewidth=1)
axes.text(50, 47, "impossible below", rotation=45, ha="center", va="top", color="#444444")
axes.set(xlabel="steps proven necessary", ylabel="steps taken", xlim=(0, 65), ylim=(0, 65))
axes.set_aspect("equal")
axes.legend(frameon=False, loc="lower right")
axes.spines[["top", "right"]].set_visible(False)

# %%
# The step ratio
# --------------
# The ratio divides the steps of a solved trial by the steps proven necessary. The curve shows the
# share of all trials that were solved with at most that ratio.

figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
for ratio, colour, name in (
    (oracle.step_ratio, "#0072b2", "oracle"),
    (policy.step_ratio, "#d55e00", "trained policy"),
):
    ordered = np.append(np.sort(ratio), 32.0)
    share = np.minimum(np.arange(1, len(ratio) + 2), len(ratio)) / len(trials)
    axes.step(ordered, share, where="post", color=colour, label=name)
    print(f"{name}: median {np.median(ratio):.2f}, 95th percentile {np.percentile(ratio, 95):.2f}")
axes.set(
    xlabel="step ratio", ylabel="share of trials", xscale="log", xlim=(0.95, 32), ylim=(0, 1.02)
)
axes.set_xticks([1, 2, 4, 8, 16, 32], ["1", "2", "4", "8", "16", "32"])
axes.minorticks_off()
axes.legend(frameon=False, loc="center right")
axes.spines[["top", "right"]].set_visible(False)
axes.grid(alpha=0.3)
