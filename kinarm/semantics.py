"""The version of what simulator and learners compute.

It covers every number that follows from settings and seeds: drawn starts, goals and trials,
rollouts and iterations of the learners; what the oracle makes of them has a version of its own,
`kinarm.policies.oracle.ORACLE_SEMANTICS`. Finished trainings of a reproduction are recognised by
it; how the code is written, named and laid out does not matter.

Raise it in the commit that changes such a number on purpose, and record the golden digests anew:
``python tests/golden/digests.py --record`` (which refuses other digests under the same version, as
the tests do). Finished trainings are then made anew.
"""

SEMANTICS = "4"
