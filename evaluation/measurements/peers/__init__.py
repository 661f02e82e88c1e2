"""Other people's simulators and learners beside kinarm, in the same run."""
