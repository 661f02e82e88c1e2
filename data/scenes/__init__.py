"""Scenes, as TOML files."""
