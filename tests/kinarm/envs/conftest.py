"""A single environment, to be reset by each test."""

import gymnasium
import pytest


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("kinarm/ReachRight-v0").unwrapped
