"""Re-reads a file that was written and compares it with what it should hold."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.formats._dxf_read import DxfContent, read_dxf_content
from turnscan.formats._formats import exporter_for
from turnscan.formats._options import DEFAULTS, DxfForm, ExportOptions, Profiles
from turnscan.formats._plain import SIGMA_DECIMALS, points_to_write
from turnscan.formats._read import soup
from turnscan.formats._text import decimals_for
from turnscan.mesh import Mesh, PointCloud, is_closed, measured, soundness

EZDXF_BYTES = 2_000_000
"""ezdxf reads about half a megabyte of faces a second; larger files only our own reader reads."""
VOLUME = 1e-6
"""A part's volume should survive its file to this relative accuracy."""
_COLOURED = (".ply", ".obj", ".3mf", ".glb")
"""Formats that hold vertices and their colours."""
_COLOURLESS = (".stl", ".dxf", ".xyz")
_THINNER = "choose a format with more digits, such as PLY, or decimate the mesh first"
_REMEDY = "write the file again; if the error persists, report it as a defect of turnscan"


def audit(
    data: bytes,
    what: Mesh | PointCloud | Profiles,
    suffix: str,
    *,
    options: ExportOptions = DEFAULTS,
    profiles: Profiles | None = None,
) -> list[Finding]:
    """Re-read bytes that `export` gave for the same arguments, and return what does not agree.

    Compares the count of faces and points, every corner, the bounds and the volume, each to the
    rounding of the format, and in a PLY the values at each vertex. A DXF of up to 2 MB is also
    audited by ezdxf; a note says when it is larger. Errors mean a damaged file; a warning, that
    the format's rounding moves the volume by more than 1e-6.
    """
    try:
        if suffix.lower() == ".dxf":
            content = read_dxf_content(data)
            found = _dxf(content, what, options, profiles)
            if _errors(found):
                return found
            # Several forms hold the same triangles several times: one is examined.
            forms = (content.faces, content.polyfaces, content.meshes)
            one = next((triangles for triangles in forms if len(triangles)), None)
            seen = [] if one is None else less_sound(soup("DXF", one), what)
            return found + _by_ezdxf(data) + seen + _uncoloured(what, suffix)
        read = exporter_for(suffix).read(data)
    except InputError as e:
        return [_error("unreadable", e.message)]
    assert not isinstance(what, Profiles)
    points = what.vertices if isinstance(what, Mesh) else what.points
    if suffix.lower() == ".xyz":
        points, _ = points_to_write(what)
    step = _step(points, suffix, options)
    if suffix.lower() == ".xyz" or isinstance(what, PointCloud) or not len(what.faces):
        found = _compare_points(read.vertices, points, step, "points")
    else:
        wanted = what.triangles[_drawn(what)] if suffix.lower() == ".glb" else what.triangles
        found = _compare_faces(read.triangles, wanted, step, "faces")
        if suffix.lower() in _COLOURED:
            found += _compare_points(read.vertices, points, step, "vertices")
    if _errors(found):
        return found
    found += _values(read, what, suffix, options) + less_sound(read, what)
    return found + (_unmarked(what) if suffix.lower() == ".stl" else []) + _uncoloured(what, suffix)


def _unmarked(what: Mesh | PointCloud) -> list[Finding]:
    """That an STL does not mark the faces that were not measured, where there are some."""
    if not isinstance(what, Mesh) or what.measured is None or what.measured.all():
        return []
    text = f"{int((~what.measured).sum())} faces were not measured; an STL cannot mark them"
    return [Finding("export.unmarked", "note", text, "", "write a PLY, OBJ, 3MF or DXF as well")]


def _uncoloured(what: Mesh | PointCloud | Profiles, suffix: str) -> list[Finding]:
    """That a format holds no colours, where the mesh has some."""
    if not isinstance(what, Mesh) or what.colour is None or suffix.lower() not in _COLOURLESS:
        return []
    text = f"the mesh has colours; a {suffix.lower()} file holds none"
    return [Finding("export.no-colours", "note", text, "", "write a PLY, OBJ, 3MF or GLB as well")]


def less_sound(read: Mesh, what: Mesh | PointCloud | Profiles) -> list[Finding]:
    """What is not sound about a mesh as it was read, but was about the one that was written.

    Formats round, and those without vertices join equal vertices. A file of points alone has
    nothing that could be sound.
    """
    if not isinstance(what, Mesh) or not len(what.faces) or not len(read.faces):
        return []
    if np.array_equal(read.triangles, what.triangles) and len(read.vertices) == len(what.vertices):
        return []
    now = soundness(read)
    before = {f.code for f in soundness(what)} if now else set()
    found = [replace(f, remedy=_THINNER) for f in now if f.code not in before]
    if is_closed(what) and not is_closed(read):
        text = "the surface is closed, but not closed in this file"
        found.append(Finding("surface.open", "warning", text, "", _THINNER))
    return found


def _error(word: str, message: str, where: str = "") -> Finding:
    return Finding(f"export.{word}", "error", message, where, _REMEDY)


def _errors(found: list[Finding]) -> bool:
    return any(f.severity == "error" for f in found)


def _step(points: Floats, suffix: str, options: ExportOptions) -> float:
    """Return by how much the format may move a coordinate, mm."""
    largest = float(np.abs(points).max(initial=0.0))
    rounding = exporter_for(suffix).rounding
    if rounding is not None:
        return rounding(points)
    binary = not options.ascii
    if (suffix.lower() == ".stl" and binary) or suffix.lower() == ".glb":
        return 1.1 * largest * 2.0**-24 + 1e-45  # and what the way to metres and back rounds
    single = largest * 2.0**-24 + 1e-45 if suffix.lower() == ".ply" and options.single else 0.0
    if suffix.lower() == ".ply" and binary:
        return single
    return 0.501 * 10.0 ** -decimals_for(points) + largest * 2.0**-51 + single


def _compare_points(got: Floats, wanted: Floats, step: float, name: str) -> list[Finding]:
    """Compare (n, 3) points one by one, and their bounds."""
    if len(got) != len(wanted):
        return [_error("count", f"{len(got)} {name} read, {len(wanted)} written")]
    if not len(got):
        return []
    off = np.abs(got - wanted).max(axis=1)
    if off.max() > step:
        i = int(np.argmax(off))
        message = f"a point is off by {off[i]:.3g} mm, the format rounds to {step:.3g} mm"
        return [_error("coordinates", message, f"{name}, number {i + 1}")]
    return []


def _compare_faces(got: Floats, wanted: Floats, step: float, name: str) -> list[Finding]:
    """Compare (f, 3, 3) corners one by one, then the volume."""
    if len(got) != len(wanted):
        return [_error("count", f"{len(got)} {name} read, {len(wanted)} written")]
    found = _compare_points(got.reshape(-1, 3), wanted.reshape(-1, 3), step, f"vertices of {name}")
    if found or not len(wanted):
        return found
    centre = wanted.reshape(-1, 3).mean(axis=0)
    volume, again, area = _volume(wanted, centre), _volume(got, centre), _area(wanted)
    change = abs(again - volume)
    reach = float(np.abs(wanted - centre).max(initial=0.0))
    if change > _volume_step(wanted - centre, step):
        return [_error("volume", f"{again:.9g} mm³ read, {volume:.9g} mm³ written", name)]
    if change > VOLUME * abs(volume) and abs(volume) > 1e-3 * area * reach:
        return [
            Finding(
                "export.rounding",
                "warning",
                f"rounding to {step:.3g} mm moves the volume by {change / abs(volume):.2g}",
                name,
                "move the part nearer to the origin, or choose a format with more digits",
            )
        ]
    return []


def _volume(triangles: Floats, centre: Floats) -> float:
    t = triangles - centre
    return float(np.einsum("ij,ij->", t[:, 0], np.cross(t[:, 1], t[:, 2])) / 6.0)


def _volume_step(t: Floats, step: float) -> float:
    """Return a bound on the change of the volume when every corner moves by a step."""
    r = np.linalg.norm(t, axis=2)
    sides = sum(np.linalg.norm(np.cross(t[:, i], t[:, i - 1]), axis=1) for i in range(3))
    first = 2.0 * step * float(np.sum(sides)) / 6.0
    second = 6.0 * step**2 * float(np.sum(r + step))
    return first + second + 1e-14 * float(np.sum(r.prod(axis=1)))


def _area(triangles: Floats) -> float:
    sides = triangles[:, 1:] - triangles[:, :1]
    return float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2.0)


def _dxf(
    content: DxfContent,
    what: Mesh | PointCloud | Profiles,
    options: ExportOptions,
    profiles: Profiles | None,
) -> list[Finding]:
    forms: tuple[DxfForm, ...] = options.dxf_forms
    if isinstance(what, Profiles):
        forms = ("profiles",)
    lines = what if isinstance(what, Profiles) else profiles
    drawn: list[Floats] = []
    for form in forms:
        if form == "profiles" and lines is not None:
            drawn.append(lines.points)
        elif isinstance(what, Mesh):
            drawn.append(what.vertices)
    step = _step(np.concatenate(drawn), ".dxf", options)
    read: dict[DxfForm, Floats] = {
        "3dface": content.faces,
        "polyface": content.polyfaces,
        "mesh": content.meshes,
    }
    found: list[Finding] = []
    for kind, corners in read.items():
        wanted = np.empty((0, 3, 3))
        if kind in forms and isinstance(what, Mesh):
            wanted = what.triangles[_drawn(what)]
        found += _compare_faces(corners.reshape(-1, 3, 3), wanted, step, f"faces as {kind}")
    if isinstance(what, Mesh) and what.measured is not None:
        filled = len([f for f in forms if f != "profiles"]) * int((~what.measured).sum())
        if int(content.filled.sum()) != filled:
            text = f"{int(content.filled.sum())} faces read as not measured, {filled} written"
            found.append(_error("values", text))
    if "profiles" in forms and lines is not None:
        found += _runs(content.runs, lines, step)
    return found


def _drawn(mesh: Mesh) -> npt.NDArray[np.intp]:
    """The order of faces in formats that keep two groups: first those that were measured."""
    if mesh.measured is None:
        return np.arange(len(mesh.faces))
    return np.argsort(~mesh.measured, kind="stable")


def _runs(got: tuple[Floats, ...], profiles: Profiles, step: float) -> list[Finding]:
    every = [run for runs in profiles.lines.values() for run in runs]
    wanted = [run for run in every if len(run) > 1] + [run for run in every if len(run) == 1]
    if [len(run) for run in got] != [len(run) for run in wanted]:
        sizes = f"{len(got)} runs with {sum(map(len, got))} points read"
        return [_error("count", f"{sizes}, {len(wanted)} with {sum(map(len, wanted))} written")]
    return _compare_points(np.concatenate(got), np.concatenate(wanted), step, "points of profiles")


def _by_ezdxf(data: bytes) -> list[Finding]:
    if len(data) > EZDXF_BYTES:
        size = f"{len(data) / 1e6:.0f} MB"
        text = f"the file has {size}; ezdxf was not asked, only turnscan's own reader"
        return [Finding("export.ezdxf-skipped", "note", text)]
    import ezdxf
    from ezdxf.filemanagement import read

    try:
        document = read(io.StringIO(data.decode("ascii")))
        auditor = document.audit()
    except (ezdxf.DXFError, UnicodeDecodeError) as e:  # type: ignore[attr-defined]
        return [_error("ezdxf", f"ezdxf cannot read it: {e}")]
    return [_error("ezdxf", e.message) for e in (*auditor.errors, *auditor.fixes)]


def _values(
    read: Mesh, what: Mesh | PointCloud, suffix: str, options: ExportOptions
) -> list[Finding]:
    """Compare what stands at each vertex beside its position."""
    found: list[Finding] = []
    if (
        suffix.lower() in (".ply", ".obj", ".3mf", ".glb")
        and isinstance(what, Mesh)
        and not _same_marks(read, what, suffix)
    ):
        found.append(_error("values", "the measured-face marks differ from those written"))
    if isinstance(what, Mesh) and not _same_colour(read, what, suffix):
        found.append(_error("values", "colour differs from what was written"))
    if suffix.lower() not in (".ply", ".xyz"):
        return found
    origin = what.provenance if isinstance(what, Mesh) else what
    sigma = None if origin is None else origin.sigma
    if suffix.lower() == ".xyz":
        _, sigma = points_to_write(what)
    if (
        origin is not None
        and sigma is not None
        and not (suffix.lower() == ".xyz" and np.isnan(sigma).all())
    ):
        if read.provenance is None:
            return [_error("values", "sigma of the points is missing")]
        same = np.isclose(
            read.provenance.sigma,
            sigma,
            rtol=2.0**-23 if options.single else 2.0**-50,
            atol=0.501 * 10.0**-SIGMA_DECIMALS,
            equal_nan=True,
        )
        if not same.all():
            where = f"vertex {int(np.argmin(same)) + 1}"
            found.append(_error("values", "sigma differs from what was written", where))
        if suffix.lower() == ".ply":
            for name in ("laser", "step", "line"):
                if not np.array_equal(getattr(read.provenance, name), getattr(origin, name)):
                    found.append(_error("values", f"{name} differs from what was written"))
    return found


def _same_colour(read: Mesh, what: Mesh, suffix: str) -> bool:
    """Whether the vertices have their colours, in formats that hold them; 3MF those of faces that
    were measured."""
    if what.colour is None or suffix.lower() not in _COLOURED:
        return True
    some = measured(what) if suffix.lower() == ".3mf" else np.ones(len(what.faces), np.bool_)
    used = np.unique(what.faces[some])
    if not len(used):
        return True
    return read.colour is not None and np.array_equal(read.colour[used], what.colour[used])


def _same_marks(read: Mesh, what: Mesh, suffix: str) -> bool:
    """Whether the same faces count as measured; all of them where nothing is said."""
    every = np.ones(len(what.faces), dtype=np.bool_)
    got, wanted = (every if m.measured is None else m.measured for m in (read, what))
    return bool(np.array_equal(got, wanted[_drawn(what)] if suffix.lower() == ".glb" else wanted))
