"""Bytes for CAD and print; every writer has a reader that audits it."""
