"""The server behind the browser workshop: one more door to the same rooms as the command line."""

from turnscan.app._library import Library
from turnscan.app._server import Listening, serve
from turnscan.app._workshop import Workshop

__all__ = ["Library", "Listening", "Workshop", "serve"]
