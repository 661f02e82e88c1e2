"""Data that ships with kinarm: arms (URDF), trained policies and recorded results."""
