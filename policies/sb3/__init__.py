"""kinarm for users of Stable-Baselines3 and rl-zoo3."""
