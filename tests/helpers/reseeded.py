"""Policies as other training seeds would record them."""

from dataclasses import replace

from kinarm.policies import Policy


def reseeded(policy: Policy, seed: int) -> Policy:
    """A policy that records another seed."""
    return replace(policy, provenance=replace(policy.provenance, seed=seed))
