"""Runs a plan on devices into a scan file."""

from turnscan.acquire._run import Sink, Turn, even_turn, run

__all__ = ["Sink", "Turn", "even_turn", "run"]
