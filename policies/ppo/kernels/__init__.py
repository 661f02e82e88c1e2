"""Compiled kernels of PPO: its networks, the gradient of its loss, and Adam.

Arrays are of single precision, as in Stable-Baselines3. Nothing is computed by libm, BLAS or
torch, and every sum has an order of its own, whatever the vector registers or the threads: the
results are the same bits on every machine. Products are fused with sums (IEEE 754's
``fusedMultiplyAdd``), which machines without such an instruction compute slowly, with equal bits.
"""
