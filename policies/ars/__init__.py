"""Augmented Random Search, for the registry of learners."""

from kinarm.policies.ars.config import ARSConfig
from kinarm.policies.ars.recipes import RECIPES, adapted
from kinarm.policies.ars.state import ARSState
from kinarm.policies.learners import Learner, imported

LEARNER = Learner(
    name="ars",
    title="Augmented Random Search",
    config=ARSConfig,
    state=ARSState,
    recipes=RECIPES,
    adapt=adapted,
    begin=imported("kinarm.policies.ars.algorithm", "ARSTraining"),
    policy=imported("kinarm.policies.ars.algorithm", "trained_policy"),
    options=("threads",),
)
