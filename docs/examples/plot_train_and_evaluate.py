"""
Train and evaluate
==================

A short training with Augmented Random Search, and the trained policy in trials that it has not
seen, beside random actions.
"""

# %%
# Train
# -----
# :py:func:`~kinarm.policies.recipe` returns settings for a problem by name, with replacements. All
# perturbed policies of an iteration face the same four starts and goals, success earns a bonus, and
# the step size falls linearly to zero. :py:func:`~kinarm.policies.train_policy` returns the policy
# and one point of the learning curve per iteration.

import matplotlib.pyplot as plt
import numpy as np

from kinarm.evaluation import evaluate
from kinarm.policies import recipe, train_policy

config = recipe(
    "ars", "tuned", problem="right", iterations=800, episodes=4, reward={"collision": -1.0}
)
result = train_policy(config)

steps = np.array([point.environment_steps for point in result.curve]) / 1e6
returns = np.array([point.mean_return for point in result.curve])
success = np.array([point.success for point in result.curve])

window = 20
figure, panels = plt.subplots(2, 1, figsize=(6.4, 5.2), sharex=True, layout="constrained")
for axes, values, colour, label in (
    (panels[0], returns, "#0072b2", "mean return"),
    (panels[1], success, "#d55e00", "share that reach the goal"),
):
    running = np.convolve(values, np.full(window, 1 / window), mode="valid")
    axes.plot(steps, values, color=colour, linewidth=0.7, alpha=0.35, label="iteration")
    axes.plot(steps[window - 1 :], running, color=colour, label=f"mean of {window} iterations")
    axes.set_ylabel(label)
    axes.legend(frameon=False, loc="best")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.3)
panels[1].set(xlabel="environment steps [million]", ylim=(0, 1))

# %%
# The episodes of the curve are those of the *perturbed* policies, so they say how the training
# goes and not how good the policy is.
#
# Evaluate
# --------
# :py:func:`~kinarm.evaluation.evaluate` puts a policy to trials whose starts and goals depend on
# problem and seed alone. The baseline ``"random"`` acts uniformly at random in the same trials.
# Shares come with 95 % intervals.

evaluations = {
    "trained": evaluate(result.policy, trials=200),
    "random": evaluate("random", "right", trials=200),
}
for name, evaluation in evaluations.items():
    low, high = evaluation.success.ci95
    print(
        f"{name:8} success {evaluation.success.value:.0%} ({low:.0%} to {high:.0%}), "
        f"median final distance {evaluation.metrics['median_distance'].value:.3f} m, "
        f"collisions {evaluation.collision.value:.0%}"
    )

figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
edges = np.arange(0.0, 1.65, 0.05)
for (name, evaluation), colour in zip(evaluations.items(), ("#0072b2", "#999999"), strict=True):
    distance = evaluation.rollouts.distance
    weights = np.full(distance.size, 1 / distance.size)
    axes.hist(distance, edges, weights=weights, color=colour, alpha=0.65, label=name)
axes.axvline(0.05, color="#444444", linestyle=":", linewidth=1)
axes.text(0.06, 0.97, "tolerance", transform=axes.get_xaxis_transform(), fontsize=8, va="top")
axes.set(
    xlabel="final distance to the goal [m]", ylabel="share of trials per 0.05 m", xlim=(0, None)
)
axes.legend(frameon=False)
axes.spines[["top", "right"]].set_visible(False)

# %%
# A policy keeps its settings and versions. It can be written to a file and loaded again: see
# :doc:`/explanation/policies`. The recipe itself, without replacements, trains longer and on more
# scenarios.

# sphinx_gallery_thumbnail_number = 2
