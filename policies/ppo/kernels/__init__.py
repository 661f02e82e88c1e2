"""Compiled kernels of PPO: its networks, the gradient of its loss, and Adam.

Arrays are of single precision, as in Stable-Baselines3. Results are the same bits on every machine:
nothing is computed by libm, BLAS or torch, and the order of every sum is fixed. Products are fused
with sums (IEEE 754's ``fusedMultiplyAdd``).
"""
