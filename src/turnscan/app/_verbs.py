"""Verbs with files, as jobs: a request's values become the arguments of a workflow, no more."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from turnscan import workflows as w
from turnscan.app import _requests as q
from turnscan.app._files import Files, Item
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._library import SUFFIX, Library
from turnscan.app._protocol import ResultFile, ResultTable, VerbEntry, Verbs
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress
from turnscan.remedy import Option

Options = TypeVar("Options")
_MAIN = ("output", "outputs")
"""Outputs whose files have the name alone; those of others have what they are behind it."""


@dataclass(frozen=True)
class Given:
    """What a verb is called with, checked."""

    inputs: Mapping[str, Sequence[Item]]
    options: Mapping[type[Any], Any]
    outputs: Mapping[str, Sequence[Path]]
    table: Callable[[str], Path]
    """The table of values that has a name in the list."""
    history: Path
    """Of verifications."""
    progress: Progress

    def path(self, name: str) -> Path:
        """The one file of an input."""
        return self.inputs[name][0].path

    def perhaps(self, name: str) -> Path | None:
        """The file of an input that may be left out."""
        return self.path(name) if self.inputs[name] else None

    def paths(self, name: str) -> list[Path]:
        """All files of an input."""
        return [item.path for item in self.inputs[name]]

    def of(self, kind: type[Options]) -> Options:
        """The options of a class."""
        found: Options = self.options[kind]
        return found


@dataclass(frozen=True)
class Outcome:
    """What a verb came to, in words and figures; its files are written."""

    text: str
    findings: Sequence[Finding] = ()
    figures: str | None = None
    """JSON."""
    tables: Sequence[w.ReportTable] = ()


def list_verbs(number: int) -> Verbs:
    """The verbs and their schemas, in the words of the protocol."""
    listed = [
        VerbEntry(verb=v.name, title=v.title, group=v.group, json_schema=v.json_schema())
        for v in w.VERBS.values()
    ]
    return Verbs(id=number, verbs=listed)


def run_verb(
    jobs: Jobs, library: Library, files: Files, request: q.RunVerb, reported: Callable[[], None]
) -> Job:
    """Begin a verb. ``reported`` is called when its files are in the folder.

    Raises InputError naming the value that cannot be used; nothing is begun then.
    """
    verb = w.VERBS.get(request.verb)
    if verb is None:
        raise InputError("no such verb", hint="reload the page")
    values = dict(request.values)
    inputs = {f.name: input_files(f, values.pop(f.name, None), files) for f in verb.inputs}
    outputs = {
        f.name: _output(f, values.pop(f.name, None), request.name, library) for f in verb.outputs
    }
    options = {part.kind: options_from(part, values) for part in verb.options}
    if values:
        unknown = next(iter(values))
        raise InputError(f"{verb.title} has no value {unknown[:80]!r}", hint="reload the page")

    def work(job: Job) -> Result:
        given = Given(inputs, options, outputs, files.table, library.history_file, job.progress)
        outcome = _RUNNERS[verb.name](given)
        if outputs.get("figures") and outcome.figures is not None:
            library.write(outputs["figures"][0], outcome.figures.encode())
        written = [path for paths in outputs.values() for path in paths if path.is_file()]
        listed = [
            ResultFile(file=library.name_of(p), name=p.name, scan=p.suffix == SUFFIX)
            for p in written
        ]
        reported()
        tables = [_table(t) for t in outcome.tables]
        text = library.hide(outcome.text)
        return Result(text, None, list(outcome.findings), listed, tables)

    return jobs.start("verb", f"{verb.title}: {request.name}", work)


def _table(of: w.ReportTable) -> ResultTable:
    rows = [[str(cell) for cell in row] for row in of.rows]
    return ResultTable(title=of.title, head=list(of.head), rows=rows)


def input_files(wanted: w.InputFile, value: object, files: Files) -> list[Item]:
    """The files that a value names. Raises InputError where they are none for this input."""
    names = [value] if isinstance(value, str) else value or []
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise InputError("not a list of files", option=Option(wanted.name))
    try:
        items = [files.find(name) for name in names]
    except InputError as e:
        raise InputError(e.message, hint=e.hint, option=Option(wanted.name)) from None
    for item in items:
        if not set(item.kinds) & set(wanted.accepts):
            raise InputError(
                f"{item.name} is {_in_words(item.kinds)}, not {_in_words(wanted.accepts)}",
                hint="choose another file",
                option=Option(wanted.name),
            )
    if wanted.required and not items:
        raise InputError("no file is chosen", hint="choose or drop one", option=Option(wanted.name))
    if len(items) > 1 and not wanted.many:
        raise InputError("more than one file", hint="choose one", option=Option(wanted.name))
    return items


def _in_words(kinds: Sequence[str]) -> str:
    return " or ".join("pictures" if k == "pictures" else f"a {k}" for k in kinds) or "a result"


def _output(wanted: w.OutputFile, value: object, name: str, library: Library) -> list[Path]:
    suffixes = list(wanted.usual) if value is None else value
    if not isinstance(suffixes, list) or not all(s in wanted.suffixes for s in suffixes):
        known = ", ".join(wanted.suffixes)
        raise InputError(f"choose among {known}", option=Option(wanted.name))
    if wanted.required and not suffixes:
        raise InputError("none is chosen", hint="choose one or more", option=Option(wanted.name))
    full = name if wanted.name in _MAIN else f"{name}-{wanted.name}"
    try:
        return [library.new_file(full, suffix) for suffix in dict.fromkeys(suffixes)]
    except InputError as e:
        raise InputError(e.message, hint=e.hint, option=Option("name")) from None


def options_from(part: w.OptionsOf, values: dict[str, Any]) -> Any:
    """The options of a class, which are taken from the values. Raises InputError."""
    given = {name: values.pop(name) for name in part.declared if name in values}
    return part.kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in given.items()})


# The verbs


def _import(given: Given) -> Outcome:
    lasers = by_laser(given.inputs["pictures"], given.of(w.SeriesOptions).laser)
    text = given.of(w.SeriesOptions).angles
    at = w.parse_angles(text)
    if isinstance(at, w.ListedAngles):
        try:
            at = w.ListedAngles(given.table(text))
        except InputError:
            raise InputError(
                "neither a step (step:15), nor markers, nor a CSV file in the list",
                hint="write step: and the degrees between pictures, or send the CSV file",
                option=Option("angles", text),
            ) from None
    off = dark_of(lasers, given.paths("dark"))
    done = w.import_pictures(
        lasers, given.outputs["output"][0], at, dark=off, rig=given.perhaps("rig"),
        options=given.of(w.ImportOptions), progress=given.progress,
    )  # fmt: skip
    return Outcome("\n".join(done.summary), done.findings)


def _calibrate(given: Given) -> Outcome:
    lasers = {} if not given.inputs["laser"] else by_laser(given.inputs["laser"], "laser", "laser")
    dark = dark_of(lasers, given.paths("laser_dark"), "laser_dark")
    camera, table, off = (given.perhaps(name) for name in ("camera", "table", "table_dark"))
    pictures = w.CalibrationPictures(
        camera=None if camera is None else str(camera),
        laser={name: str(path) for name, path in lasers.items()},
        table=None if table is None else str(table),
        laser_dark={name: str(path) for name, path in dark.items()} or None,
        table_dark=None if off is None else str(off),
    )
    done = w.calibrate(
        pictures, given.of(w.BoardOptions).board, given.outputs["output"][0],
        given.of(w.CalibrateOptions), rig=given.perhaps("rig"),
        report=next(iter(given.outputs["report"]), None), progress=given.progress,
    )  # fmt: skip
    lacking = [f"not calibrated yet: {missing}" for missing in done.advice.undetermined]
    lines = [*done.stages, *lacking, f"would help most: {done.advice.text}"]
    return Outcome("\n".join(lines), done.findings)


def dark_of(
    lasers: Mapping[str, Path], dark: Sequence[Path], field: str = "dark"
) -> dict[str, Path]:
    """The series without laser of each laser: one for all, or one each. Raises InputError."""
    if len(dark) not in (0, 1, len(lasers)):
        raise InputError(
            f"{len(dark)} series without laser for {len(lasers)} lasers",
            hint="choose one for all, or one for each in the same order",
            option=Option(field),
        )
    return {laser: dark[k if len(dark) > 1 else 0] for k, laser in enumerate(lasers) if dark}


def by_laser(series: Sequence[Item], laser: str, field: str = "pictures") -> dict[str, Path]:
    """Each series of pictures by the name of its laser: its folder's, where there are several."""
    if len(series) == 1:
        return {laser: series[0].path}
    for item in series:
        if item.sent and item.path.is_dir() and Path(item.name).name != item.path.name:
            raise InputError(
                f"{item.name} and its series say no laser",
                hint="put the pictures of each laser into a zip named like the laser",
                option=Option(field),
            )
    named = {i.path.name if i.path.is_dir() else i.path.stem: i.path for i in series}
    if len(named) != len(series):
        raise InputError(
            "two series have one name", hint="rename their folders", option=Option(field)
        )
    return named


def _stages(given: Given) -> tuple[Progress, Progress]:
    """Progress of the work, and of writing its files: making a solid takes longer than the rest."""
    share = 0.3 if w.check_step(given.outputs["outputs"]) else 1.0
    return given.progress.subrange(0, share), given.progress.subrange(share, 1)


def _formats(given: Given) -> w.ExportOptions:
    return given.of(w.FormatOptions).export_options(given.outputs["outputs"])


def _surface(
    result: w.ReconstructResult, given: Given, formats: w.ExportOptions, progress: Progress
) -> Outcome:
    """Write what became of a reconstruction; where it failed, the report alone."""
    remarks: list[Finding] = []
    if not result.failed:
        remarks = result.save(*given.outputs["outputs"], options=formats, progress=progress)
    for path in given.outputs["report"]:
        result.save_report(path)
    lines = result.summary()
    if result.failed:
        lines = ["There is no surface: see the findings.", *lines]
    return Outcome("\n".join(lines), [*result.findings, *remarks], tables=result.tables)


def _range_scans(given: Given) -> Outcome:
    formats = _formats(given)  # what excludes each other is said at once
    told, rest = _stages(given)
    result = w.reconstruct(
        given.path("source"), given.of(w.ReconstructOptions), edits="none",
        unit=given.of(w.RangeScanOptions).unit, progress=told,
    )  # fmt: skip
    return _surface(result, given, formats, rest)


def _join(given: Given) -> Outcome:
    formats = _formats(given)
    changes, poses = given.of(w.ReconstructOptions).changed(), given.of(w.JoinOptions)
    rig, (told, rest) = given.perhaps("rig"), _stages(given)
    result = w.join(
        given.paths("sources"),
        points=given.perhaps("points"), markers=poses.markers,
        reference=given.perhaps("reference"),
        rig=None if rig is None else w.read_rig_file(rig), unit=poses.unit,
        progress=told, **changes,
    )  # fmt: skip
    return _surface(result, given, formats, rest)


def _export(given: Given) -> Outcome:
    w.check_targets(given.outputs["outputs"], given.paths("source"))
    done = w.export(
        given.path("source"), *given.outputs["outputs"],
        formats=_formats(given),
        decimate=given.of(w.ReconstructOptions).decimate, progress=given.progress,
    )  # fmt: skip
    size = f"{len(done.mesh.vertices)} vertices, {len(done.mesh.faces)} faces"
    return Outcome(f"{size}, read back the same", [*done.findings, *done.remarks])


def _section(given: Given) -> Outcome:
    options = given.of(w.SectionOptions)
    cuts = w.cuts_of(options.plane, options.half_plane_deg, options.silhouette, options.unrolled)
    found = w.section(given.path("part"), cuts, options.tolerance, given.progress)
    found.save(*given.outputs["outputs"], version=options.dxf_version)
    return Outcome(str(found), found.findings)


def _compare(given: Given) -> Outcome:
    options = given.of(w.CompareOptions)
    found = w.compare(
        given.path("measured"), given.path("reference"), options,
        tolerance_table=given.perhaps("tolerance_table"), progress=given.progress,
    )  # fmt: skip
    for path in given.outputs["picture"]:
        found.save_picture(path, options.limit)
    remarks = found.save_map(*given.outputs["outputs"], limit=options.limit)
    for path in given.outputs["report"]:
        found.save_report(path, options.limit)
    figures = json.dumps(found.figures(), indent=1)
    text = "\n".join(found.summary())
    return Outcome(text, [*found.findings, *remarks], figures, found.tables)


def _measure(given: Given) -> Outcome:
    options, reports = given.of(w.MeasureOptions), given.outputs["report"]
    options = replace(options, sizes=options.sizes or bool(reports))
    found = w.measure(given.path("file"), options, progress=given.progress)
    for path in reports:
        found.save_report(path)
    figures = json.dumps(found.figures, indent=1)
    return Outcome("\n".join(found.summary()), found.findings, figures, found.tables)


def _shapes(given: Given) -> Outcome:
    told, rest = _stages(given)
    found = w.find_shapes(given.path("part"), given.of(w.ShapesOptions), progress=told)
    remarks = found.save(*given.outputs["outputs"], progress=rest)
    for path in given.outputs["report"]:
        found.save_report(path)
    return Outcome(str(found), [*found.findings, *remarks], json.dumps(found.figures(), indent=1))


def _revolve(given: Given) -> Outcome:
    w.check_step(given.outputs["outputs"])
    found = w.revolve(given.path("part"), given.of(w.RevolveOptions), progress=given.progress)
    remarks = found.save(*given.outputs["outputs"])
    for path in given.outputs["report"]:
        found.save_report(path)
    return Outcome(str(found), [*found.findings, *remarks], json.dumps(found.figures(), indent=1))


def _check(given: Given) -> Outcome:
    done = w.check(given.path("file"), given.progress)
    figures = json.dumps(done.figures(), indent=1, allow_nan=False)
    return Outcome("\n".join([*done.summary, done.verdict]), done.findings, figures)


def _verify(given: Given) -> Outcome:
    rig = given.perhaps("rig")
    done = w.verify(
        given.paths("scans"), given.path("artefact"),
        time=time.time(), rig=None if rig is None else w.read_rig_file(rig),
        limits=given.of(w.VerifyOptions).by_test, history=given.history, progress=given.progress,
    )  # fmt: skip
    figures = w.verification_json(done)
    for path in given.outputs["report"]:
        text = w.verification_html(done) if path.suffix == ".html" else figures
        w.write_atomically(path, text.encode())
    return Outcome("\n".join(w.verification_lines(done)), done.findings, figures)


_RUNNERS: dict[str, Callable[[Given], Outcome]] = {
    "import": _import,
    "calibrate": _calibrate,
    "range-scans": _range_scans,
    "join": _join,
    "export": _export,
    "section": _section,
    "compare": _compare,
    "measure": _measure,
    "shapes": _shapes,
    "revolve": _revolve,
    "check": _check,
    "verify": _verify,
}
