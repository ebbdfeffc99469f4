"""RangeGrid(s) → Mesh: tears, seam, merge of lasers, spacing."""

from turnscan.surface._mesh import Mesh, Provenance

__all__ = ["Mesh", "Provenance"]
