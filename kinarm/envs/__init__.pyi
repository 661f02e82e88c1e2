from .errors import ClosedEnvironmentError as ClosedEnvironmentError
from .errors import ResetNeededError as ResetNeededError
from .errors import UnexpectedArgumentError as UnexpectedArgumentError
from .goal import ReachGoalEnv as ReachGoalEnv
from .goal import ReachGoalVectorEnv as ReachGoalVectorEnv
from .reach import ReachEnv as ReachEnv
from .vector import ReachVectorEnv as ReachVectorEnv
