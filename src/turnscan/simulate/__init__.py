"""The physical simulator: scene, optics, sensor, motion."""
