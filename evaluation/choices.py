"""Names that a policy can be chosen by."""


def policy_choices() -> tuple[str, ...]:
    """Names of policies, their groups and baselines."""
    from kinarm.evaluation.contestants import UNTRAINED
    from kinarm.policies.library import BEST, group_of, policy_names

    names = policy_names()
    return (BEST, *dict.fromkeys(map(group_of, names)), *names, *UNTRAINED)
