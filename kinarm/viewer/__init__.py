"""The viewer: pictures, recordings as pages that play offline, and scenes that are served live."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
