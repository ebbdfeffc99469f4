"""A mesh as trimmed surfaces: shapes where it has them, else swept profiles and B-splines."""

from turnscan.shapes.patches._borders import Border, Bordering, Borders
from turnscan.shapes.patches._charts import Charting, Charts
from turnscan.shapes.patches._patch import Patch
from turnscan.shapes.patches._surfaces import FlatPatch, ShapePatch, SplinePatch, flat_patch
from turnscan.shapes.patches._swept_surfaces import ExtrudedPatch, SweptPatch, TurnedPatch

__all__ = [
    "Border",
    "Bordering",
    "Borders",
    "Charting",
    "Charts",
    "ExtrudedPatch",
    "FlatPatch",
    "Patch",
    "ShapePatch",
    "SplinePatch",
    "SweptPatch",
    "TurnedPatch",
    "flat_patch",
]
