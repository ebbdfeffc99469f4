"""A mesh as trimmed surfaces: shapes where it has them, B-splines fitted to the rest."""

from turnscan.shapes.patches._borders import Border, Borders, borders_of
from turnscan.shapes.patches._charts import Charts, charts_of
from turnscan.shapes.patches._surfaces import Patch, ShapePatch, SplinePatch

__all__ = [
    "Border",
    "Borders",
    "Charts",
    "Patch",
    "ShapePatch",
    "SplinePatch",
    "borders_of",
    "charts_of",
]
