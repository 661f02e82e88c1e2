"""Augmented Random Search, for the registry of learners."""

from kinarm.policies.ars.config import ARSConfig, ARSState
from kinarm.policies.learners import imported
from kinarm.policies.recipes import shipped_learner

LEARNER = shipped_learner(
    "ars",
    ARSConfig,
    title="Augmented Random Search",
    state=ARSState,
    begin=imported("kinarm.policies.ars.algorithm", "ARSTraining"),
    policy=imported("kinarm.policies.ars.algorithm", "trained_policy"),
    options=("threads",),
)
