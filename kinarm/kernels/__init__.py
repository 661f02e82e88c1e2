"""Compiled kernels: whole episodes, each step proven free of contact or left to Coal.

Arguments that kernels share, whose fields go by their own names where a kernel takes them apart:

chain, shapes, rules, control, episodes
    `Chain`, `ContactShapes`, `Rules`, `Control` and `Episodes`.
first, last : int
    Range of rows to work on.
row, e : int
    Row of the arrays of a batch: which configuration or episode.
pair : int
    Row of ``pairs``: which two bodies.
poses : ndarray, shape (n_joints + 1, POSE)
    Forward kinematics: row 0 is the world, row k the frame of the k-th joint.
"""
