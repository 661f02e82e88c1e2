"""Environments for Gymnasium: one arm, and a native batch of many; importing it registers them."""

import lazy_loader

from kinarm.envs.registration import register_environments

register_environments()

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
