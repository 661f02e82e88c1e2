"""Compiled kernels: whole episodes, each step proven free of contact or left to Coal."""
