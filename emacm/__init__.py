"""Condition monitoring of electro-mechanical actuators and other rotating machines."""

import lazy_loader

# The stub names the module of each public name; it is imported when the name is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
