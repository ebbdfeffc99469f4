"""The rules by which faces are selected."""

SELECTION_RULES = """\b
laser=NAME         seen by one laser
steps=A-B          seen at these steps; A > B: across the seam
sigma=MM           with a larger sigma, mm
flag=NAME          stripes of a quality: saturated, halo, edge, multi, grazing, ambiguous
cause=NAME         along holes of a cause: laser, camera, dark, saturated, outside, deleted, …
pieces=N           loose pieces of fewer faces
piece=X,Y,Z        the loose piece nearest to a point
crease=X,Y,Z,DEG   what is reached from there without crossing an edge sharper than DEG"""
