"""Compiled kernels of the oracle: proofs by branch and bound, and inverse kinematics."""
