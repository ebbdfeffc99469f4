"""A picture that tells colours, and where the camera stood when it was taken."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.arrays import Image
from turnscan.rig import Camera, Pose


@dataclass(frozen=True, eq=False)
class TexturePicture:
    """One picture without laser light.

    Raises ValueError where the picture has not the size of the camera's, or no grey scale.
    """

    pixels: Image
    """(H, W) grey or (H, W, 3) red, green, blue; uint8 or uint16."""
    camera: Camera
    T_camera_object: Pose
    """The object's frame (that of the mesh) → the camera's frame."""
    white: float
    """The grey level at which a pixel is full."""

    def __post_init__(self) -> None:
        size = (self.camera.height, self.camera.width)
        if self.pixels.shape not in (size, (*size, 3)):
            raise ValueError(f"TexturePicture.pixels: {self.pixels.shape}, expected {size}")
        if not self.white > 0:
            raise ValueError(f"TexturePicture.white: {self.white}, expected above 0")
