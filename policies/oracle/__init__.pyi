from .inverse import inverse_kinematics as inverse_kinematics
from .oracle import ORACLE_SEMANTICS as ORACLE_SEMANTICS
from .oracle import Oracle as Oracle
from .oracle import Progress as Progress
from .solution import OracleSolution as OracleSolution
from .solution import OracleSolutions as OracleSolutions
