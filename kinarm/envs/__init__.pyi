from .reach import ReachEnv as ReachEnv
from .vector import ReachVectorEnv as ReachVectorEnv
