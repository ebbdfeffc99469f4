"""Reading what a person names on the command line."""

from turnscan.workflows._reading import read_mesh_file, read_rig_file

__all__ = ["read_mesh_file", "read_rig_file"]
