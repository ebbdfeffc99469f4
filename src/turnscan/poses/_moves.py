"""How the vertices of a joined mesh move with the uncertainty of the poses."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.poses._align import Alignment


def pose_moves(found: Alignment, mesh: Mesh) -> list[Floats]:
    """(v, 3) mm each: one standard deviation along each principal direction of each pose.

    A pose moves the vertices that it measured as a whole, x by t + r × (x − middle); the lasers of
    a mesh that was joined have names that begin with their pose's. Nothing without provenance.
    """
    p, out = mesh.provenance, list[Floats]()
    if p is None:
        return out
    for name, middle, covariance in zip(found.names, found.middles, found.covariance, strict=True):
        mine = np.isin(p.laser, [k for k, n in enumerate(p.lasers) if n.startswith(f"{name} ")])
        values, vectors = np.linalg.eigh(covariance)
        for value, v in zip(values, vectors.T, strict=True):
            if value > 0 and mine.any():
                field = np.zeros_like(mesh.vertices)
                field[mine] = v[3:] + np.cross(v[:3], mesh.vertices[mine] - middle)
                out.append(np.sqrt(value) * field)
    return out
