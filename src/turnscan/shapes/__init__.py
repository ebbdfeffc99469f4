"""Mesh and points → planes and other primitives, with residuals and uncertainty."""
