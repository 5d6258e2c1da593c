"""Cars at the limits of handling, learned and controlled in Drake, and the sim-to-real gap diagnosed.

`__init__.pyi` lists the library's names; each is imported from its module when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
