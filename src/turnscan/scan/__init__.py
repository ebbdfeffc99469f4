"""The scan file and the pictures that go into it: the only code that writes one."""

from turnscan.scan._pictures import (
    is_video,
    list_pictures,
    natural_key,
    picture_numbers,
    read_picture,
    read_video,
)

__all__ = [
    "is_video",
    "list_pictures",
    "natural_key",
    "picture_numbers",
    "read_picture",
    "read_video",
]
