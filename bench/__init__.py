"""Benchmarks; ``python -m bench`` runs them."""

from turnscan.threads import single_threaded_algebra

single_threaded_algebra()
