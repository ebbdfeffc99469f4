"""What is written passes the same check as what was made, in every format."""

import os

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.formats import random_parts as parts
from turnscan.formats import audit, export, read_mesh
from turnscan.mesh import is_closed, soundness

FORMATS = (".stl", ".ply", ".obj", ".3mf", ".dxf")


@settings(max_examples=500 if "TURNSCAN_EXPLORE" in os.environ else 24)
@given(
    seed=st.integers(0, 1_000_000),
    verbs=st.lists(st.sampled_from(parts.VERBS), max_size=3),
    suffix=st.sampled_from(FORMATS),
)
def test_what_check_says_of_the_file_is_what_the_verb_said(seed, verbs, suffix):
    rng = np.random.default_rng(seed)
    mesh = parts.worked(parts.part(rng), verbs, rng)
    if not len(mesh.faces):
        return
    told = parts.said(soundness(mesh))
    data = export(mesh, suffix)
    remarks = audit(data, mesh, suffix)
    assert not [f for f in remarks if f.severity == "error"]
    read = read_mesh(data, suffix)
    if suffix in (".obj", ".3mf", ".dxf"):
        # Their decimals move a corner by up to half a nanometre: what only just touched may cut.
        told |= parts.said([f for f in remarks if f.code.startswith("surface")])
    assert parts.said(soundness(read)) <= told, "nothing is worse in the file, or it was said"
    assert is_closed(read) == is_closed(mesh)
