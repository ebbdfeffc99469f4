"""Runs a plan on devices into a scan file."""

from turnscan.acquire._run import Turn, even_turn, run

__all__ = ["Turn", "even_turn", "run"]
