"""Views of a part that are no sections: its silhouette, and its surface unrolled."""

from turnscan.shapes._section import silhouette_cut, unrolled_cut
from turnscan.shapes.views._silhouette import outermost, silhouette
from turnscan.shapes.views._unrolled import Relief, unrolled

__all__ = ["Relief", "outermost", "silhouette", "silhouette_cut", "unrolled", "unrolled_cut"]
