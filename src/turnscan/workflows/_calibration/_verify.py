"""Verify: scans of an artefact → test values, verdicts, repeatability, and a history with drift."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from turnscan import __version__
from turnscan.detection import detect_scan
from turnscan.errors import FormatError, InputError, LimitExceeded
from turnscan.findings import Finding, record
from turnscan.formats import EXPORTERS, read_mesh
from turnscan.gridding import to_grids
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig, rig_to_json
from turnscan.scan import (
    Scan,
    VerifiedFigure,
    VerifiedRun,
    add_verification,
    lit_in,
    read_verifications,
    rig_for,
)
from turnscan.settings import Settings
from turnscan.shapes.verification import (
    Artefact,
    Drift,
    Survey,
    Test,
    TestValue,
    artefact_from_text,
    drift,
    repeatability,
    survey_of_grids,
    survey_of_mesh,
    tests_of,
    values_of,
)

_MAX_ARTEFACT, _MAX_MESH = 1 << 20, 4 << 30
_ERRORS = ("size", "distance", "thickness", "height")
"""Tests whose values are 0 for a scanner without error."""


@dataclass(frozen=True)
class Verified:
    """What one scan gave."""

    source: Path
    values: tuple[TestValue, ...]
    rig_key: str
    """Digest of its rig; empty where unknown."""
    findings: tuple[Finding, ...] = ()
    """What is wrong with its points; notes are left out."""


@dataclass(frozen=True)
class Trend:
    """One test value in all runs with this artefact and this rig, in the order of time."""

    name: str
    times: tuple[float, ...]
    """Seconds since 1970, UTC."""
    values: tuple[float, ...]
    """mm."""
    noise: tuple[float, ...]
    """mm, standard uncertainty of each by itself."""
    limit: float | None
    drift: Drift

    @property
    def alarm(self) -> bool:
        """Whether the newest value stands beyond the limit of its control chart."""
        return bool(len(self.values) and self.drift.alarm[-1])


@dataclass(frozen=True)
class VerificationHistory:
    """All runs with one artefact and one rig."""

    artefact: str
    """Its name."""
    rig_key: str
    """Digest of the rig; empty where unknown."""
    trends: tuple[Trend, ...]


@dataclass(frozen=True)
class Verification:
    """The result of `verify`."""

    artefact: Artefact
    time: float
    """Seconds since 1970, UTC."""
    scans: tuple[Verified, ...]
    repeated: tuple[TestValue, ...]
    """The scatter of each value over the scans; empty for one scan."""
    trends: tuple[Trend, ...]
    """Empty without a history."""
    findings: tuple[Finding, ...]

    @property
    def passed(self) -> bool:
        """No limit was exceeded and no drift was found."""
        return all(f.severity != "error" for f in self.findings)


def verify(
    sources: Sequence[str | PathLike[str]],
    artefact: str | PathLike[str],
    *,
    time: float,
    rig: Rig | None = None,
    limits: Mapping[str, float] | None = None,
    history: str | PathLike[str] | None = None,
    progress: Progress = no_progress,
) -> Verification:
    """Test a scanner by its scans (or meshes made of them) of one artefact.

    The definitions of the test values stand in `turnscan.shapes.verification._values`, the rule of
    the drift alarm in `drift`. A value beyond its limit, and a drift, are findings of severity
    error. The history is written last, and by nothing that fails.

    Parameters
    ----------
    sources
        Files of scans or meshes, each one scan, in the order of time.
    artefact
        The file of what was measured on it (TOML or JSON).
    time
        When it was, in seconds since 1970, UTC.
    rig
        Replaces the rigs of the scan files.
    limits
        mm, by the name of the test; they replace those of the artefact's file.
    history
        An SQLite file that the run is added to, and made where it is not there.
    progress
        Told how far it is; it may cancel.

    Returns
    -------
    Verification
        The test values with their uncertainty, and what is wrong with them.

    Raises
    ------
    InputError, FormatError, ScanError, LimitExceeded
        Where a file cannot be used, or the artefact is not in a scan.

    >>> import turnscan as ts
    >>> ts.verify(["cup.turnscan"], "ball-bar.toml", time=0.0)
    Traceback (most recent call last):
    turnscan.errors.InputError: ball-bar.toml: no such file → check the name
    """
    files = [Path(source) for source in sources]
    history = None if history is None else Path(history)
    body = _with_limits(read_artefact(Path(artefact)), limits or {})
    past = [] if history is None else read_verifications(history)
    if not files:
        raise InputError("no scan to verify", hint="name a scan of the artefact")
    if len({s.resolve() for s in files}) < len(files):
        raise InputError("a scan is given twice", hint="name each scan once")
    scans = tuple(
        _verified(source, body, rig, progress.subrange(k / len(files), (k + 1) / len(files)))
        for k, source in enumerate(files)
    )
    repeated = repeatability([s.values for s in scans], body.limits.get("repeatability"))
    trends = tuple[Trend, ...]()
    if history is not None:
        runs = [_run(body, time, key, scans) for key in dict.fromkeys(s.rig_key for s in scans)]
        every = sorted([*past, *runs], key=lambda r: r.time)
        trends = _trends(_comparable(body, every, scans[-1].rig_key), body.scatter)
    said = _findings(body, scans, repeated, trends)
    if history is not None:
        for run in runs:
            add_verification(history, run)
    return Verification(body, time, scans, tuple(repeated), trends, tuple(said))


def read_artefact(path: Path) -> Artefact:
    """Read the file of an artefact. Raises InputError where there is none, FormatError."""
    data = _read(path, _MAX_ARTEFACT)
    try:
        return artefact_from_text(data.decode(), str(path))
    except UnicodeDecodeError:
        raise FormatError(f"{path}: not a text file", hint="give the artefact's .toml") from None


def verification_json(v: Verification) -> str:
    """All of a verification as JSON, mm, unrounded; what is not known is null."""
    facts: dict[str, Any] = {
        "artefact": {"name": v.artefact.name, "kind": v.artefact.kind},
        "time": v.time,
        "passed": v.passed,
        "scans": [{"source": str(s.source), "values": [*map(_plain, s.values)]} for s in v.scans],
        "repeatability": [*map(_plain, v.repeated)],
        "trends": [_trend_json(t) for t in v.trends],
        "findings": [record(f) for f in v.findings],
        "program": f"turnscan {__version__}",
    }
    return json.dumps(facts, indent=1, allow_nan=False, ensure_ascii=False)


def _plain(v: TestValue) -> dict[str, Any]:
    known = None if math.isnan(v.calibration) else v.calibration
    return {
        "test": v.test, "of": v.where, "value_mm": v.value, "U_mm": v.expanded,
        "sigma_noise_mm": v.noise, "sigma_calibration_mm": known, "sigma_artefact_mm": v.artefact,
        "limit_mm": v.limit, "verdict": v.verdict, "points": v.points, "left_out": v.left_out,
    }  # fmt: skip


def _trend_json(t: Trend) -> dict[str, Any]:
    return {
        "name": t.name, "times": t.times, "values_mm": t.values, "noise_mm": t.noise,
        "up": t.drift.up.tolist(), "down": t.drift.down.tolist(),
        "scatter_mm": t.drift.scatter, "alarm": t.alarm,
    }  # fmt: skip


def _with_limits(body: Artefact, given: Mapping[str, float]) -> Artefact:
    known = tests_of(body.kind)
    limits = dict[Test, float](body.limits)
    for name, value in given.items():
        test = next((t for t in known if t == name), None)
        if test is None:
            raise InputError(
                f"limit {name!r}: no test of a {body.kind}", hint=f"there is {', '.join(known)}"
            )
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"limit {name} = {value:g} mm", hint="give a length above 0")
        limits[test] = value
    return replace(body, limits=limits)


def _verified(source: Path, body: Artefact, rig: Rig | None, progress: Progress) -> Verified:
    try:
        survey, key, said = _survey(source, rig, progress)
        return Verified(source, tuple(values_of(body, survey)), key, tuple(said))
    except InputError as e:
        if str(source) in e.message:
            raise
        raise type(e)(f"{source}: {e.message}", hint=e.hint) from None


def _survey(source: Path, rig: Rig | None, progress: Progress) -> tuple[Survey, str, list[Finding]]:
    """What was seen of the artefact, the digest of the rig, and what is wrong with the points."""
    if source.suffix.lower() in EXPORTERS:
        return survey_of_mesh(read_mesh(_read(source, _MAX_MESH), source.suffix)), "", []
    with Scan.open(source) as scan:
        known, s = rig_for(scan, rig), Settings()
        looks = sum(len(lit_in(n, known)) * len(scan.steps(n)) for n in scan.plan.lasers)
        tick = progress.counter(looks, "verifying")
        grids, _, found = to_grids(detect_scan(scan, known, s.stripes, s.volume, tick), s)
    said = [
        replace(f, where=", ".join(filter(None, (source.name, f.where))))
        for f in found
        if f.severity != "note"
    ]
    return survey_of_grids(grids, known), _key(rig_to_json(known)), said


def _read(path: Path, limit: int) -> bytes:
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}", hint="check the name")
    if path.stat().st_size > limit:
        raise LimitExceeded(f"{path}: {path.stat().st_size} bytes; at most {limit} are read")
    return path.read_bytes()


def _key(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _artefact_key(body: Artefact) -> str:
    """What makes values comparable: its dimensions, not its limits."""
    return _key(repr(replace(body, limits={}, scatter=None, measured="")))


def _run(body: Artefact, time: float, key: str, scans: Sequence[Verified]) -> VerifiedRun:
    figures = [
        VerifiedFigure(
            k, s.source.name, v.name, v.value, v.noise, v.calibration, v.artefact, v.limit
        )
        for k, s in enumerate(scans)
        if s.rig_key == key
        for v in s.values
    ]
    return VerifiedRun(time, body.name, _artefact_key(body), key, __version__, tuple(figures))


def verification_history(path: str | PathLike[str]) -> tuple[VerificationHistory, ...]:
    """What a history file holds, by artefact and rig, the newest last; none where there is no file.

    The scatter that drift is judged by is that of the history itself. Raises FormatError for a file
    that is no history, ScanNewer, ScanCorrupt, ScanBusy and InputError as `verify`.
    """
    groups = dict[tuple[str, str], list[VerifiedRun]]()
    for run in sorted(read_verifications(Path(path)), key=lambda r: r.time):
        groups.setdefault((run.artefact_key, run.rig_key), []).append(run)
    return tuple(
        VerificationHistory(runs[-1].artefact, rig_key, _trends(runs, None))
        for (_, rig_key), runs in sorted(groups.items(), key=lambda group: group[1][-1].time)
    )


def _comparable(
    body: Artefact, runs: Sequence[VerifiedRun], rig_key: str
) -> tuple[VerifiedRun, ...]:
    """The runs with this artefact and this rig."""
    key = _artefact_key(body)
    return tuple(r for r in runs if r.artefact_key == key and r.rig_key == rig_key)


def _trends(runs: Sequence[VerifiedRun], scatter: float | None) -> tuple[Trend, ...]:
    """Of each value, all that was measured in these runs."""
    series = dict[str, list[tuple[float, VerifiedFigure]]]()
    for run in runs:
        for f in run.figures:
            series.setdefault(f.name, []).append((run.time, f))
    made = []
    for name, all_of in series.items():
        values = tuple(f.value for _, f in all_of)
        noise = tuple(f.noise for _, f in all_of)
        chart = drift(values, noise, scatter)
        times = tuple(t for t, _ in all_of)
        made.append(Trend(name, times, values, noise, all_of[-1][1].limit, chart))
    return tuple(made)


def _findings(
    body: Artefact,
    scans: Sequence[Verified],
    repeated: Sequence[TestValue],
    trends: Sequence[Trend],
) -> list[Finding]:
    said = []
    if not body.measured.strip():
        said.append(
            Finding(
                "verify.nominal", "warning",
                "the dimensions of the artefact are those of its drawing; it has not been measured",
                body.name, "measure it once, and enter the values and who measured them into its "
                           "file",
            )
        )  # fmt: skip
    for s in scans:
        said += s.findings
        for v in s.values:
            said += _of_value(v, s.source.name)
    for v in repeated:
        said += _of_value(v, "all scans")
    said += [_drifted(t) for t in trends if t.alarm]
    if any(not s.rig_key for s in scans):
        said.append(
            Finding(
                "verify.rig-unknown", "note",
                "a mesh does not contain the uncertainty of its rig's calibration, so that part "
                "of the uncertainty is unknown", remedy="give the scan file",
            )
        )  # fmt: skip
    return said


def _of_value(v: TestValue, where: str) -> list[Finding]:
    told = f"{v.name}: {v.value:+.4f} mm ± {v.expanded:.4f} mm (k = 2)"
    if v.exceeded and v.limit is not None:
        return [
            Finding(
                "verify.limit", "error", f"{told}, limit {v.limit:g} mm", where,
                "calibrate again, and check focus, exposure and what holds the artefact",
            )
        ]  # fmt: skip
    known = not math.isnan(v.calibration) and v.calibration > 0
    if known and v.test in _ERRORS and abs(v.value) > v.expanded:
        return [
            Finding(
                "verify.unexplained", "warning",
                f"{told}: more than the uncertainties of noise, calibration and artefact "
                f"explain", where,
                "check whether camera, laser or table have moved since the calibration",
            )
        ]  # fmt: skip
    return []


def _drifted(t: Trend) -> Finding:
    first = int(t.drift.alarm.argmax()) + 1
    up, down, score = (float(v[-1]) for v in (t.drift.up, t.drift.down, t.drift.score))
    way = "up" if up > down else "down"
    return Finding(
        "verify.drift", "error",
        f"{t.name} drifts {way}: {t.values[-1]:+.4f} mm, first {t.values[0]:+.4f} mm; {score:+.1f} "
        f"standard deviations off the values before (alarm beyond 4), cumulative sum "
        f"{max(up, down):.1f} (alarm above 5)",
        f"value {first} of {len(t.values)}",
        "check what has moved (laser, camera, table), then calibrate again",
    )  # fmt: skip
