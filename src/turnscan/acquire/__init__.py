"""Runs a plan on devices into a scan file."""
