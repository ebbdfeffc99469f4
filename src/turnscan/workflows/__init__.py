"""The verbs of turnscan as functions, which the command line, the browser and Python call.

Each takes typed options and one `turnscan.progress.Progress`, and returns its result with what was
found. Names are imported when they are used, so that a door waits only for what it needs.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
