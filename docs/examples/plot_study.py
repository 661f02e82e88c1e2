"""
A small study
=============

Two step sizes and two ranges of starts for Augmented Random Search, two seeds each: eight
trainings, judged on the same trials beside the oracle.
"""

# %%
# A study is a file, or a dictionary with the same entries. Each training becomes one small file in
# the folder; the same call again would find everything finished.

import tempfile

from kinarm.evaluation import Study
from kinarm.evaluation.experiments.page import effects, learning_curves

study = Study(
    {
        "name": "steps",
        "learner": "ars",
        "recipe": "tuned",
        "problem": "right",
        "seeds": 2,
        "trials": {"count": 200, "per_decade": 6},
        "fixed": {"iterations": 150, "episodes": 4},
        "grid": {"step_size": [0.01, 0.04], "problem.task.start_spread": [0.2, 1.0]},
    },
    tempfile.mkdtemp(),
)
study.run(jobs=1, threads=2)

for group in study.best(4):
    low, high = group.success.ci95
    print(f"{group.label:32} success {group.success.value:.0%} ({low:.0%} to {high:.0%})")

# %%
# Starts close to home are easier to learn from. The dotted line is what the oracle reaches.

curves = learning_curves(study)

# %%
# The mean over everything else that varies, with intervals over seeds and trials:

panels = effects(study)

# %%
# ``study.table()`` has one row a training; ``kinarm-study`` does the same from a file, and writes a
# page. See :doc:`/how-to/studies`.

table = study.table()
print(table.dtype.names)

# sphinx_gallery_thumbnail_number = 1
