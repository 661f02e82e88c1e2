"""
In a notebook
=============

Train, evaluate, plot and replay in one sitting. Download this page as a Jupyter notebook at its
end: every cell runs as it stands.
"""

# sphinx_gallery_thumbnail_number = 1

# %%
# Train
# -----
# A result describes itself in one line. Longer runs show a progress bar in a notebook if the
# package ipywidgets is installed.

from kinarm.policies import recipe, train_policy

result = train_policy(recipe("ars", "tuned", problem="right", iterations=800, episodes=4))
print(result)

# %%
# Evaluate
# --------
# The policy knows its problem. It faces trials that its training never saw, and an interval says
# how far the figure can be trusted.

from kinarm.evaluation import evaluate

evaluation = evaluate(result.policy, trials=200)
print(evaluation)

# %%
# Plot
# ----
# The learning curve is a list of points, and the outcomes of the trials are arrays.

import matplotlib.pyplot as plt
import numpy as np

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.0), layout="constrained")
steps = np.array([point.environment_steps for point in result.curve]) / 1e6
left.plot(steps, [point.success for point in result.curve], linewidth=0.7)
left.set(xlabel="environment steps [million]", ylabel="success of perturbed policies", ylim=(0, 1))
right.hist(evaluation.rollouts.distance, np.arange(0, 1.05, 0.05))
right.axvline(0.05, color="0.3", linestyle=":")
right.set(xlabel="final distance to the goal [m]", ylabel="trials")

# %%
# Replay
# ------
# The page of a replay shows itself in the notebook, and needs no network. Here are the trials that
# ended farthest from their goals.

from kinarm.evaluation import record
from kinarm.viewer import replay_page

worst = np.argsort(-evaluation.rollouts.distance)[:3]
replay_page(record(evaluation.contestant, evaluation.trials, worst))
