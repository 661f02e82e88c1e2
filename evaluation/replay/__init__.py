"""Replays: finding and choosing trials, recording contestants, following them live."""
