"""``python -m turnscan``."""

from turnscan.cli import main

main()
