"""What a face of a solid lies on: one of all surfaces."""

from __future__ import annotations

from turnscan.shapes.patches._surfaces import FlatPatch, ShapePatch, SplinePatch
from turnscan.shapes.patches._swept_surfaces import SweptPatch

Patch = SplinePatch | SweptPatch | ShapePatch | FlatPatch
