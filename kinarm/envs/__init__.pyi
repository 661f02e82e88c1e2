from .goal import ReachGoalEnv as ReachGoalEnv
from .goal import ReachGoalVectorEnv as ReachGoalVectorEnv
from .reach import ReachEnv as ReachEnv
from .vector import ReachVectorEnv as ReachVectorEnv

ENVIRONMENTS: dict[str, str]
