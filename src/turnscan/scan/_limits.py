"""What turnscan accepts from files it did not write: one place for every limit."""

from __future__ import annotations

from turnscan.errors import LimitExceeded

IMAGE_PIXELS = 100_000_000
"""Pixels of one picture or frame."""
PICTURE_BYTES = 1 << 30
"""Bytes of one picture file."""
NAME_BYTES = 200
"""UTF-8 bytes of one name, for example of a laser."""
STEPS = 1_000_000
"""Steps of one scan."""
EXPOSURES = 100
"""Exposures of one step."""


def check_pixels(width: int, height: int, where: str) -> None:
    """Raise LimitExceeded, before anything is allocated, for a picture that is too large."""
    if width * height > IMAGE_PIXELS:
        raise LimitExceeded(
            f"{where}: is declared as {width}×{height} = {width * height / 1e6:.0f} Mpx; "
            f"at most {IMAGE_PIXELS / 1e6:.0f} Mpx are accepted",
            hint="crop or shrink the picture, or check that it is not damaged",
        )
