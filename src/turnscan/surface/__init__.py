"""Range grids → mesh; its packages: fusion of grids, holes, decimation, clean-up."""

from turnscan.surface._findings import mesh_findings
from turnscan.surface._grid_mesh import TearLimits, mesh_grid, thin

__all__ = ["TearLimits", "mesh_findings", "mesh_grid", "thin"]
