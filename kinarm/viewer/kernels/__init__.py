"""Compiled kernels of the renderer: triangles to samples, samples to light and pixels."""
