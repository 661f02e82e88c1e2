"""Compiled kernels of the renderer: triangles to samples, light and pixels."""
