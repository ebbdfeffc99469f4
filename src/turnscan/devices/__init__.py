"""Camera, Turntable and Lasers: the protocols every device obeys."""
