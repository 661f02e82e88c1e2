"""Replays: choosing and recording trials."""
