"""DXF: triangles as 3DFACE, polyface or MESH, and profiles as 3-D polylines."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.formats._dxf_frame import Frame, frame
from turnscan.formats._options import DEFAULTS, DxfForm, DxfVersion, ExportOptions, Profiles
from turnscan.formats._text import HEX, Longs, decimals_for, rows_text, scaled
from turnscan.mesh import Mesh, submesh

MAX_POLYFACE_VERTICES = 32_767
"""Faces name vertices by signed 16-bit numbers counted from 1 (Autodesk's group code table)."""
MAX_POLYFACE_FACES = 32_000
_COLOURS = (7, 1, 5, 3, 6, 4, 2)
_ORANGE = 30
FILLED = "FILLED"
"""In the layer's name of faces that close a gap and were not measured."""
_BLOCK = 1 << 16


def write_dxf(
    mesh: Mesh | None, options: ExportOptions = DEFAULTS, profiles: Profiles | None = None
) -> bytes:
    """Return a DXF file with every chosen form on a layer of its own; the unit is mm.

    Faces that were not measured are on a layer of their own, too, with FILLED in its name.

    Each form needs what it draws: ``profiles`` the profiles, the others the mesh. The same
    input gives the same bytes.

    Raises InputError where that is missing or empty; ExportError where a coordinate is beyond
    what can be written.
    """
    points = _points_of(mesh, options, profiles)
    decimals = decimals_for(points)
    layers = _layers(mesh, options, profiles)
    bounds = np.stack([points.min(axis=0), points.max(axis=0)])
    document = frame(options.dxf_version, layers, bounds, options.about)
    body = _Body(document, options.dxf_version, decimals)
    parts: list[bytes] = []
    for form in options.dxf_forms:
        if form == "profiles":
            assert profiles is not None
            names = _profile_layers(profiles)
            for laser, lines in profiles.lines.items():
                parts += body.polylines(lines, names[laser])
            continue
        assert mesh is not None
        draw = {"3dface": body.faces, "polyface": body.polyfaces, "mesh": body.mesh}[form]
        for layer, part in _by_layer(mesh, form):
            parts += draw(part, layer)
    return document.around(parts, body.handle)


def _points_of(mesh: Mesh | None, options: ExportOptions, profiles: Profiles | None) -> Floats:
    """Return all points to be drawn, (n, 3), or say what is missing."""
    found: list[Floats] = []
    for form in options.dxf_forms:
        if form == "profiles":
            if profiles is None or not len(profiles.points):
                raise InputError(
                    "DXF form profiles: there are no profiles",
                    hint="export from a scan or from range grids, or choose form 3dface",
                )
            found.append(profiles.points)
        elif mesh is None or not len(mesh.faces):
            raise InputError(
                f"DXF form {form}: the mesh has no faces",
                hint="check the region of interest, or choose form profiles",
            )
        else:
            found.append(mesh.vertices)
    return np.concatenate(found)


def _by_layer(mesh: Mesh, form: DxfForm) -> list[tuple[str, Mesh]]:
    """The faces that were measured, and those that were not, each with their layer."""
    if mesh.measured is None or mesh.measured.all():
        return [(_layer(form), mesh)]
    parts = [(_layer(form), submesh(mesh, mesh.measured))] if mesh.measured.any() else []
    return [*parts, (_layer(form, FILLED), submesh(mesh, ~mesh.measured))]


def _layer(form: DxfForm, laser: str = "", tail: str = "") -> str:
    """Return a layer name that R12 accepts: at most 31 of A-Z 0-9 _ - $."""
    plain = re.sub("[^A-Z0-9_-]", "_", laser.upper())[: 10 - len(tail)]
    word = f"_{plain}{tail}" if laser else ""
    return f"TURNSCAN_{form.upper()}{word}_MM"


def _profile_layers(profiles: Profiles) -> dict[str, str]:
    """Return a layer of its own for each laser; what R12 makes alike gets a number."""
    names: dict[str, str] = {}
    for laser in profiles.lines:
        tails = ("", *(f"_{number}" for number in range(2, len(profiles.lines) + 1)))
        tries = (_layer("profiles", laser, tail) for tail in tails)
        name = next(name for name in tries if name not in names.values())
        names[laser] = name
    return names


def _layers(mesh: Mesh | None, options: ExportOptions, profiles: Profiles | None) -> dict[str, int]:
    names: list[str] = []
    filled: list[str] = []
    for form in options.dxf_forms:
        if form == "profiles" and profiles is not None:
            names += _profile_layers(profiles).values()
        else:
            names.append(_layer(form))
            if mesh is not None and mesh.measured is not None and not mesh.measured.all():
                filled.append(_layer(form, FILLED))
    known = {name: _COLOURS[i % len(_COLOURS)] for i, name in enumerate(dict.fromkeys(names))}
    return known | dict.fromkeys(filled, _ORANGE)


class _Body:
    """Entities one after the other, each with the next free handle."""

    def __init__(self, document: Frame, version: DxfVersion, decimals: int) -> None:
        self.handle = document.first_handle
        self._owner = document.owner
        self._modern = version != "R12"
        self._decimals = decimals

    def faces(self, mesh: Mesh, layer: str) -> Iterator[bytes]:
        """Draw every triangle as a 3DFACE whose fourth corner repeats the third."""
        words = self._entity("3DFACE", layer, "AcDbFace")
        groups = [f"{axis}{corner}\n" for corner in range(4) for axis in (1, 2, 3)]
        words = [words[0], words[1] + groups[0], *(f"\n{group}" for group in groups[1:]), "\n"]
        whole = scaled(mesh.vertices, self._decimals)
        places = [HEX, *[self._decimals] * 12]
        for at in range(0, len(mesh.faces), _BLOCK):
            corners = whole[mesh.faces[at : at + _BLOCK][:, [0, 1, 2, 2]]].reshape(-1, 12)
            yield from rows_text(self._numbered(corners), places, words)

    def polyfaces(self, mesh: Mesh, layer: str) -> Iterator[bytes]:
        """Draw the mesh as as many polyface meshes as the 16-bit vertex numbers require."""
        from turnscan.formats._write_kernels import split_polyfaces

        face_starts, vertex_starts, used, local = split_polyfaces(
            mesh.faces, len(mesh.vertices), MAX_POLYFACE_VERTICES, MAX_POLYFACE_FACES
        )
        whole = scaled(mesh.vertices, self._decimals)
        for run in range(len(face_starts) - 1):
            points = whole[used[vertex_starts[run] : vertex_starts[run + 1]]]
            faces = local[face_starts[run] : face_starts[run + 1]]
            sizes = f"71\n{len(points)}\n72\n{len(faces)}\n"
            yield self._polyline(layer, "AcDbPolyFaceMesh", f"70\n64\n{sizes}")
            yield from self._vertices(points, layer, "AcDbPolyFaceMeshVertex", 192)
            yield from self._face_records(faces, layer)
            yield self._seqend(layer)

    def mesh(self, mesh: Mesh, layer: str) -> Iterator[bytes]:
        """Draw the mesh as one MESH entity without subdivision (R2000 and later)."""
        handle = self._take()
        yield self._text(self._entity("MESH", layer, "AcDbSubDMesh"), handle)
        yield f"71\n2\n72\n0\n91\n0\n92\n{len(mesh.vertices)}\n".encode()
        d = self._decimals
        words = ["10\n", "\n20\n", "\n30\n", "\n"]
        yield from rows_text(scaled(mesh.vertices, d), [d, d, d], words)
        yield f"93\n{4 * len(mesh.faces)}\n".encode()
        words = ["90\n3\n90\n", "\n90\n", "\n90\n", "\n"]
        yield from rows_text(mesh.faces.astype(np.int64), [0, 0, 0], words)
        yield b"94\n0\n95\n0\n90\n0\n"

    def polylines(self, runs: tuple[Floats, ...], layer: str) -> Iterator[bytes]:
        """Draw each run of points as an open 3-D polyline, a lone point as a POINT."""
        for run in runs:
            whole = scaled(run, self._decimals)
            if len(run) == 1:
                words = self._entity("POINT", layer, "AcDbPoint")
                yield from self._coordinates(whole, words, "\n")
                continue
            yield self._polyline(layer, "AcDb3dPolyline", "70\n8\n")
            yield from self._vertices(whole, layer, "AcDb3dPolylineVertex", 32)
            yield self._seqend(layer)

    def _entity(self, kind: str, layer: str, *classes: str, owner: int = 0) -> list[str]:
        """Return the words before and after the handle, up to the first own group."""
        if not self._modern:
            return [f"0\n{kind}\n5\n", f"\n8\n{layer}\n"]
        names = "".join(f"100\n{name}\n" for name in classes)
        return [
            f"0\n{kind}\n5\n",
            f"\n330\n{owner or self._owner:X}\n100\nAcDbEntity\n8\n{layer}\n{names}",
        ]

    def _take(self) -> int:
        self.handle += 1
        return self.handle - 1

    def _numbered(self, rows: Longs) -> Longs:
        """Return rows (r, k) with the next r handles before them, (r, k + 1)."""
        handles = np.arange(self.handle, self.handle + len(rows), dtype=np.int64)
        self.handle += len(rows)
        return np.concatenate([handles[:, None], rows], axis=1)

    @staticmethod
    def _text(words: list[str], handle: int) -> bytes:
        return f"{words[0]}{handle:X}{words[1]}".encode()

    def _polyline(self, layer: str, kind: str, groups: str) -> bytes:
        self._open = self._take()
        words = self._entity("POLYLINE", layer, kind)
        return (
            self._text(words, self._open) + f"66\n1\n10\n0.0\n20\n0.0\n30\n0.0\n{groups}".encode()
        )

    def _seqend(self, layer: str) -> bytes:
        return self._text(self._entity("SEQEND", layer, owner=self._open), self._take())

    def _vertices(self, points: Longs, layer: str, kind: str, flag: int) -> Iterator[bytes]:
        words = self._entity("VERTEX", layer, "AcDbVertex", kind, owner=self._open)
        yield from self._coordinates(points, words, f"\n70\n{flag}\n")

    def _coordinates(self, points: Longs, words: list[str], end: str) -> Iterator[bytes]:
        d = self._decimals
        literals = [words[0], f"{words[1]}10\n", "\n20\n", "\n30\n", end]
        yield from rows_text(self._numbered(points), [HEX, d, d, d], literals)

    def _face_records(self, faces: np.ndarray, layer: str) -> Iterator[bytes]:
        words = self._entity("VERTEX", layer, "AcDbFaceRecord", owner=self._open)
        start = f"{words[1]}10\n0.0\n20\n0.0\n30\n0.0\n70\n128\n71\n"
        rows = self._numbered(faces.astype(np.int64) + 1)
        yield from rows_text(rows, [HEX, 0, 0, 0], [words[0], start, "\n72\n", "\n73\n", "\n"])
