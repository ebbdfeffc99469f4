"""The design tool of the paper: a rig from its geometry, with figures, picture and report."""
