"""What every file format must do, as checks that its author can run."""

from __future__ import annotations

import numpy as np

from turnscan.errors import ExportError, InputError
from turnscan.formats import Exporter, ExportOptions, audit, exporter_for
from turnscan.mesh import Mesh, Provenance

_OPTIONS = ExportOptions(about={"source": "check_format"})


def check_format(form: str | Exporter) -> None:
    """Run a file format through all that turnscan relies on.

    ``form`` is the format, or the suffix it is installed by (entry point ``turnscan.formats``).

    Checked are: what was written is read back, each face in its order and sense, each corner within
    what the format says it rounds to, for parts that are closed, open, tiny, or large and far off,
    with colours, sigma and faces that were not measured; the same mesh gives the same bytes; an
    empty file, a part of a file and noise raise an InputError, and nothing else; a coordinate that
    is no length is written right or refused.

    Raises AssertionError, saying what is not as it must be, and PluginError where it fails.
    """
    known = exporter_for(form) if isinstance(form, str) else form
    assert known.suffix.startswith("."), f"the suffix is {known.suffix!r}, without a dot"
    assert known.suffix == known.suffix.lower(), f"the suffix {known.suffix!r} has capitals"
    for name, mesh in _meshes().items():
        data = known.write(mesh, _OPTIONS)
        assert isinstance(data, bytes), f"{name}: it wrote a {type(data).__name__}, not bytes"
        assert data == known.write(mesh, _OPTIONS), f"{name}: written twice, the bytes differ"
        _check_same(name, known, mesh, known.read(data))
        if isinstance(form, str):
            found = [f for f in audit(data, mesh, form) if f.severity == "error"]
            assert not found, f"{name}: {found[0]}"
    _check_damage(known)
    _check_endless(known)


def _meshes() -> dict[str, Mesh]:
    box = _box()
    rng = np.random.default_rng(4)
    bumpy = Mesh(box.vertices + rng.normal(0, 0.3, box.vertices.shape), box.faces)
    v, f = len(box.vertices), len(box.faces)
    number = np.arange(v, dtype=np.int32)
    known = Provenance(np.linspace(0.01, 0.1, v), number * 0, number, number, ("left",))
    colour = rng.integers(0, 256, (v, 3)).astype(np.uint8)
    return {
        "a box": box,
        "an open box": Mesh(bumpy.vertices, bumpy.faces[2:]),
        "a tiny part": Mesh(bumpy.vertices * 1e-2, bumpy.faces),
        "a large part far off": Mesh(bumpy.vertices * 50.0 + 3000.0, bumpy.faces),
        "a part with all that is known": Mesh(
            bumpy.vertices, bumpy.faces, known, colour, np.arange(f) % 3 > 0
        ),
    }


def _box() -> Mesh:
    """A closed box of 10 × 20 × 30 mm, faces counter-clockwise seen from outside."""
    corners = np.array([(x, y, z) for x in (0, 10) for y in (0, 20) for z in (0, 30)], float)
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    return Mesh(corners, np.array(faces, np.int32))


def _check_same(name: str, form: Exporter, mesh: Mesh, read: Mesh) -> None:
    assert isinstance(read, Mesh), f"{name}: it read a {type(read).__name__}, not a Mesh"
    assert len(read.faces) == len(mesh.faces), (
        f"{name}: {len(read.faces)} faces read, {len(mesh.faces)} written"
    )
    largest = float(np.abs(mesh.vertices).max())
    step = 0.501e-6 if form.rounding is None else form.rounding(mesh.vertices)
    allowed = step + largest * 2.0**-51
    off = np.abs(read.triangles - mesh.triangles).max(axis=(1, 2))
    worst = int(np.argmax(off))
    assert off[worst] <= allowed, (
        f"{name}: a corner of face {worst} is read {off[worst]:.3g} mm off; the format rounds to "
        f"{step:.3g} mm. Faces keep their order and their sense"
    )


def _check_damage(form: Exporter) -> None:
    whole = form.write(_box(), _OPTIONS)
    noise = np.random.default_rng(5).integers(0, 256, 400).astype(np.uint8).tobytes()
    harmed = {f"the first {k} of {len(whole)} bytes": whole[:k] for k in (1, len(whole) // 2)}
    harmed |= {"an empty file": b"", "noise": noise, "text": b"this is no mesh\n" * 9}
    for name, data in harmed.items():
        try:
            read = form.read(data)
        except InputError:
            continue
        except Exception as e:
            raise AssertionError(
                f"{name}: it raised {type(e).__name__}, not a FormatError: {e}"
            ) from e
        raise AssertionError(f"{name}: it read {len(read.faces)} faces, and raised nothing")


def _check_endless(form: Exporter) -> None:
    far = Mesh(_box().vertices * 1e300, _box().faces)
    try:
        data = form.write(far, _OPTIONS)
    except (ExportError, InputError):
        return
    off = np.abs(form.read(data).triangles / 1e300 - far.triangles / 1e300).max()
    assert off < 1e-6, "coordinates of 1e300 mm are written as something else, and not refused"
