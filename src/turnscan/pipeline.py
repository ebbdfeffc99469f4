"""The whole story on one screen: a scan file and a rig become points, a mesh, and CAD."""
