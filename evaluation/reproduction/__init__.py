"""The paper's experiments: trainings, stored runs, and verdicts on the claims."""
