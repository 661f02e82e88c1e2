from .environment import ClosedEnvironmentError as ClosedEnvironmentError
from .environment import ResetNeededError as ResetNeededError
from .environment import UnexpectedArgumentError as UnexpectedArgumentError
from .extra import ExtraObservation as ExtraObservation
from .goal import ReachGoalEnv as ReachGoalEnv
from .goal import ReachGoalVectorEnv as ReachGoalVectorEnv
from .reach import ReachEnv as ReachEnv
from .vector import ReachVectorEnv as ReachVectorEnv

ENVIRONMENTS: dict[str, str]
