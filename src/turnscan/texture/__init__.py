"""Colour of a surface from pictures that were taken without laser light; pure."""

from turnscan.texture._colour import NEUTRAL, Colours, colours_of, texture_findings
from turnscan.texture._picture import TexturePicture

__all__ = ["NEUTRAL", "Colours", "TexturePicture", "colours_of", "texture_findings"]
