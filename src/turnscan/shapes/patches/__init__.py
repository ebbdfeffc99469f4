"""A mesh as trimmed surfaces: shapes where it has them, B-splines fitted to the rest."""

from turnscan.shapes.patches._borders import Border, Bordering, Borders
from turnscan.shapes.patches._charts import Charting, Charts
from turnscan.shapes.patches._surfaces import FlatPatch, Patch, ShapePatch, SplinePatch, flat_patch

__all__ = [
    "Border",
    "Bordering",
    "Borders",
    "Charting",
    "Charts",
    "FlatPatch",
    "Patch",
    "ShapePatch",
    "SplinePatch",
    "flat_patch",
]
