"""Evaluation: trials, statistics, figures and command lines."""
