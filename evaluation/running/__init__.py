"""Carry out many tasks: in worker processes of this machine, or wherever an executor puts them."""
