"""Command lines of the evaluation."""
