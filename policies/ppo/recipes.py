"""Settings of Proximal Policy Optimization by name."""

from kinarm.policies.ppo.config import PPOConfig

RECIPES = {
    "paper": PPOConfig(recipe="paper"),
    "tuned": PPOConfig(
        recipe="tuned",
        arms=125,
        rollout_steps=16,
        minibatch=1000,
        hidden=(64, 64, 64),
        learning_rate=1e-3,
        learning_rate_schedule="linear",
        gae_lambda=0.9,
        entropy_weight=0.002,
        initial_log_std=-0.7,
        tolerance=0.03,
        symmetric=True,
        success_bonus=5.0,
        initial_start_spread=0.2,
        widening=0.4,
    ),
}
"""PPO settings by name; both take 1.2 million environment steps, as the paper did.

``paper`` has the paper's reward and otherwise the defaults of Stable-Baselines3. ``tuned`` is the
best that we found.
"""
