"""Mutants written by hand: faults that the tests of their room once let pass, and of their kind."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from bench.mutants._mutant import Mutant

_NAMED: dict[str, list[tuple[str, str, str, str]]] = {
    "calibrate": [
        (
            "calibrate/_adjust.py",
            "widen = variance * factor**2",
            "widen = variance",
            "errors that a view's observations share do not widen the uncertainty",
        ),
        (
            "calibrate/_adjust.py",
            "count += float(w.sum()) * scales[kind] ** 2 - k",
            "count += float(w.sum()) * scales[kind] ** 2",
            "parameters are not paid for: noise comes out too small",
        ),
        (
            "calibrate/_residuals.py",
            "-np.ones_like(a), -a * a, -a * b, -b * b]",
            "-np.ones_like(a), a * a, -a * b, -b * b]",
            "sign of the derivative by a sheet's bow",
        ),
        (
            "calibrate/_rig.py",
            "np.outer(up, by[low, 2])",
            "np.outer(up, -by[low, 2])",
            "sign with which a standing board's lowest corner carries its uncertainty over",
        ),
        (
            "calibrate/_quality.py",
            "np.diag(J @ rig.covariance @ J.T)",
            "np.diag(J @ np.diag(sigma**2) @ J.T)",
            "uncertainty (k = 2) of a radius without the correlations",
        ),
    ],
    "stripes": [
        (
            "stripes/_kernels.py",
            "spread * some[i, GAIN] ** 2 / (flux * flux)",
            "spread / (flux * flux)",
            "a window that follows its own centre does not make the noise larger",
        ),
        (
            "stripes/_kernels.py",
            "spread += (HALO_BIAS * some[i, WIDTH] * min(1.0, halo + lean)) ** 2",
            "spread += 0.0",
            "what a halo drags the centre by is not in its sigma",
        ),
        (
            "stripes/_detect.py",
            "(2.0 if paired else 1.0) * (s.read_noise**2",
            "(1.0 if paired else 1.0) * (s.read_noise**2",
            "the dark picture has no read noise",
        ),
    ],
    "points": [
        (
            "points/_lopsided.py",
            "part[_dim_and_wide(light, found) | _ends(found)] = 1.0",
            "part[_dim_and_wide(light, found)] = 1.0",
            "an edge along the lines is excused at the ends of profiles",
        ),
        (
            "points/_lopsided.py",
            "np.where(cut, _BACK * skew * width, 0.0)",
            "np.where(cut, -_BACK * skew * width, 0.0)",
            "lopsided stripes are put back to the wrong side",
        ),
        (
            "points/_profile.py",
            "np.hypot((1.0 - w) * grid.sigma[k, a], w * grid.sigma[k, b])",
            "np.hypot(w * grid.sigma[k, a], (1.0 - w) * grid.sigma[k, b])",
            "a point between two takes the sigma of the farther one",
        ),
        (
            "points/_grid.py",
            "noise=None if self.noise is None else self.noise[:, lines],",
            "noise=None,",
            "a part of a grid forgets the noise of its points",
        ),
    ],
    "shapes": [
        (
            "shapes/_added.py",
            "np.linalg.norm(area, axis=1) * np.abs(away)",
            "np.linalg.norm(area, axis=1) * np.abs(away) / 2",
            "half of the uncertainty of the filled faces",
        ),
        (
            "shapes/_measure.py",
            "np.hypot(first.normal_sigma, second.normal_sigma)",
            "first.normal_sigma",
            "an angle between planes is as sure as one of them",
        ),
    ],
    "surface": [
        (
            "surface/fusion/_tsdf_kernels.py",
            "w *= cosine / max(single + gap, 1e-12)",
            "w *= cosine / max(single + gap, 1e-12) ** 0.5",
            "surfaces are merged with weight 1/σ",
        ),
        (
            "surface/fusion/_vertex_sigma.py",
            "both = 2.0 * correlation * np.sqrt",
            "both = 2.0 * np.sqrt",
            "two places on a slope have the same noise",
        ),
        (
            "surface/fusion/_range_surface.py",
            "measured = grid if grid.origin is None else grid.origin.grid",
            "measured = grid",
            "a resampled surface looks for its points' noise among its own lines",
        ),
        (
            "surface/fusion/_range_surface.py",
            "return self.sigma * np.sqrt(self.random)",
            "return self.sigma",
            "what points doubt averages out like noise",
        ),
        (
            "surface/fusion/_carve.py",
            "None if v is None else v[used]",
            "None if v is None else v[: used.sum()]",
            "what is left of a carved surface has the noise of other points",
        ),
        (
            "surface/decimation/_decimate.py",
            "crossings(done, other[kept].any(axis=1))]",
            "crossings(done, other[kept].any(axis=1))[:0]]",
            "what is dissolved may leave faces that cut through each other",
        ),
        (
            "surface/_noise.py",
            "np.sqrt(6.0)",
            "np.sqrt(2.0)",
            "a second difference has the noise of a first one",
        ),
        (
            "surface/holes/_fill.py",
            "np.radians(60.0)",
            "np.radians(75.0)",
            "a border is steep from 75° on",
        ),
    ],
    "edit": [
        (
            "edit/_measures.py",
            "int(np.linalg.norm(mesh.vertices - on, axis=1).argmin())",
            "int(np.linalg.norm(mesh.vertices - on, axis=1).argmax())",
            "a point has the sigma of the farthest vertex",
        ),
        (
            "edit/_apply.py",
            "return name.size / _LIKE <= hole.size <= name.size * _LIKE",
            "return hole.size <= name.size * _LIKE",
            "a hole of any smaller size is taken for the one that was named",
        ),
    ],
    "rig": [
        (
            "rig/_rig.py",
            "away = float(np.hypot(eye[0], eye[1])) - (centre @ along)",
            "away = float(np.hypot(eye[0], eye[1])) + (centre @ along)",
            "the light stands on the wrong side of a sheet's centre",
        ),
        (
            "rig/_rig.py",
            "np.copysign(1.0, along @ eye)",
            "-np.copysign(1.0, along @ eye)",
            "the light stands on the far side of the axis",
        ),
    ],
}


def named(room: str, sources: Path) -> Iterator[Mutant]:
    """Those of one room. Raises ValueError where the text is not there once."""
    for path, old, new, name in _NAMED.get(room, ()):
        text = (sources / path).read_text()
        if text.count(old) != 1:
            raise ValueError(f"{path} holds {old!r} {text.count(old)} times → repair the list")
        start = text.index(old)
        row = text.count("\n", 0, start) + 1
        yield Mutant(room, path, start, start + len(old), new, _function(text, row), old, name)


def _function(text: str, row: int) -> str:
    inside = [
        node.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef) and node.lineno <= row <= (node.end_lineno or 0)
    ]
    return inside[-1] if inside else ""
