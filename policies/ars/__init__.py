"""Augmented Random Search, for the registry of learners."""

from kinarm.policies.ars.config import ARSConfig, ARSState
from kinarm.policies.ars.recipes import RECIPES, adapted
from kinarm.policies.learners import Learner, imported

LEARNER = Learner(
    name="ars",
    title="Augmented Random Search",
    config=ARSConfig,
    state=ARSState,
    recipes=RECIPES,
    summaries={
        "paper": "Table 1 of the paper, which reaches little",
        "tuned": "a good linear policy, in about a minute",
        "linear": "the best linear policy that we found, in four minutes",
        "best": "the best that we found, a small network, in nine minutes",
        "v1": "Table 1 without normalisation, and with all directions",
        "brs": "v1 without scaling by the deviation of the returns",
    },
    adapt=adapted,
    begin=imported("kinarm.policies.ars.algorithm", "ARSTraining"),
    policy=imported("kinarm.policies.ars.algorithm", "trained_policy"),
    options=("threads",),
)
