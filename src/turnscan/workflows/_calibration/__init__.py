"""Calibrating, refining and verifying a rig, and the targets for it."""
