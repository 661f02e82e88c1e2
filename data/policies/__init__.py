"""Trained policies, produced by ``kinarm-train``."""
