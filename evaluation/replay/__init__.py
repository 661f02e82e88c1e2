"""Replays: choosing and recording trials, or following them live."""
