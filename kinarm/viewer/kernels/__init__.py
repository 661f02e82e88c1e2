"""Compiled kernels of the renderer: triangles to samples, samples to light and pixels.

Arguments that kernels share:

corners : ndarray, shape (n_vertices, 3)
    Vertices as the camera sees them: column and row of the picture times the distance along the
    line of sight, and that distance [m].
shadowed : ndarray, shape (n_vertices, 3)
    Vertices as the sun sees them: column and row of the shadow map, and how near the sun [m].
offsets : ndarray, shape (n_samples, 2)
    Where in a pixel its samples lie, from its upper left corner.
nearness, index : ndarray, shape (height, width, n_samples)
    What a sample shows: the inverse of its distance [1/m], and the triangle, -1 for none.
"""
