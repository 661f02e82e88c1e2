"""The oracle: what any policy could reach at best, proven and found."""

from kinarm.policies.oracle.oracle import ORACLE_SEMANTICS as ORACLE_SEMANTICS
from kinarm.policies.oracle.oracle import Oracle as Oracle
from kinarm.policies.oracle.oracle import OracleSolutions as OracleSolutions
from kinarm.policies.oracle.oracle import Progress as Progress
