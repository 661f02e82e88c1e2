"""Learners compared: success against environment steps and wall time, on the same trials."""
