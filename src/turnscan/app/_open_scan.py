"""OpenScan: a scan that is open, in the words and arrays of the protocol."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._encode_arrays import encoded, encoded_parts, figures, patch_parts
from turnscan.app._encode_picture import png
from turnscan.app._envelope import Array
from turnscan.app._files import Item
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, remarks
from turnscan.app._step_pictures import StepPictures
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress
from turnscan.workflows import (
    CAUSE_TEXTS,
    CompareOptions,
    HistoryRow,
    PlacedFinding,
    ReconstructOptions,
    ReconstructResult,
    ScanSession,
    SessionChange,
    SessionState,
    option_schemas,
)

_PREFIX = "edit-"
"""Of the names of measurements."""


class OpenScan:
    """One scan that browsers look at and repair; all of them hear what changes."""

    def __init__(
        self,
        name: str,
        path: Path,
        hub: Hub,
        job: Job,
        pictures: StepPictures,
        first: Callable[[p.FirstSurface, dict[str, Array]], None] | None = None,
    ) -> None:
        """Reconstruct, and replay the edits in the file; ``first`` gets what is shown meanwhile.

        Raises as `ScanSession`.
        """
        self.name, self.path, self._hub, self._pictures = name, path, hub, pictures
        self._telling = threading.Lock()
        """The history that was sent last is the present one."""

        def show(every: int, edits: int, arrays: Mapping[str, Array]) -> None:
            if first is not None:
                first(p.FirstSurface(scan=name, every=every, edits=edits), encoded(arrays))

        self.session = ScanSession(path, job.progress, self._tell, show)
        self._draw(self.now)

    def close(self) -> None:
        """Let the file go."""
        self.session.close()

    @property
    def used(self) -> float:
        """When somebody opened or changed it last, s of the monotonic clock."""
        return self.session.used

    @property
    def now(self) -> SessionState:
        """What it is at this moment."""
        return self.session.now

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be said about the scan and its edits."""
        return self.session.findings

    def result(self, state: SessionState, progress: Progress) -> ReconstructResult:
        """The surface as files get it."""
        return self.session.result(state, progress)

    # Seeing

    def opened(self, id: int | None) -> p.Opened:
        """Where it stands."""
        self.session.touch()
        state = self.now
        return p.Opened(
            id=id,
            scan=self.name,
            name=self.path.stem,
            revision=state.revision,
            epoch=state.epoch,
            steps=self.session.scan.plan.steps,
            textured=self.session.textured,
            grids=_grid_entries(state),
            figures=figures(state.figures),
            history=self._entries(state),
            cursor=state.document.history.cursor,
            branches=self._branches(state),
            scanned_picture=self._picture(self.session.picture_as_scanned()),
            findings=remarks(self.findings, self._hub.hide),
            measures=_measures(state),
            settings=self._settings(state),
            fields=option_schemas(ReconstructOptions),
        )

    def mesh(self) -> tuple[p.MeshHeader, dict[str, Array]]:
        """The whole surface."""
        state, arrays = self.session.surface()
        return self._mesh_header(state), encoded(arrays)

    def _mesh_header(self, state: SessionState) -> p.MeshHeader:
        provenance = state.document.body.mesh.provenance
        return p.MeshHeader(
            scan=self.name,
            revision=state.revision,
            epoch=state.epoch,
            lasers=[] if provenance is None else list(provenance.lasers),
        )

    def thumbnail(self) -> bytes:
        """The surface as a small picture, PNG."""
        return self.session.thumbnail()

    def holes(self, id: int, first: int) -> tuple[p.Holes, dict[str, Array]]:
        """Holes from the ``first`` on, each with its cause, and its border."""
        state, many, found = self.session.holes(first)
        entries = [
            p.HoleEntry(
                hole=k,
                size=h.size,
                perimeter=h.perimeter,
                area=h.area,
                centre=_vector(h.centre),
                cause=h.cause,
                cause_text=h.reason,
            )
            for k, (h, _) in enumerate(found, start=first)
        ]
        loops = {f"loop_{k}": border.astype("<f4") for k, (_, border) in enumerate(found, first)}
        answer = p.Holes(id=id, scan=self.name, revision=state.revision, many=many, holes=entries)
        return answer, loops

    def defects(self, id: int) -> p.Defects:
        """What was found wrong, with its place where it has one, and the holes."""
        state, found = self.session.defects()
        listed = []
        for one in found:
            if isinstance(one, PlacedFinding):
                remark, place = remarks([one.finding], self._hub.hide)[0], None
                grid, step = one.grid, one.step
            else:
                remark = p.Remark(
                    code="surface.hole",
                    severity="note",
                    text=f"a hole of {one.size:.1f} mm: {one.reason}",
                    where="",
                    remedy="fill it, or scan the part in another pose as well",
                )
                place, grid, step = _vector(one.centre), None, None
            listed.append(p.Defect(remark=remark, place=place, grid=grid, step=step, line=None))
        return p.Defects(id=id, scan=self.name, revision=state.revision, defects=listed)

    def stand_in(self, faces: int) -> tuple[p.MeshHeader, dict[str, Array]]:
        """A coarse surface of about so many faces."""
        state, arrays = self.session.coarse(faces)
        return self._mesh_header(state), encoded(arrays)

    def grid(self, number: int, step: int | None) -> tuple[p.GridHeader, dict[str, Array]]:
        """A grid, or one step of it. Raises InputError for one there is not."""
        state, grid, arrays = self.session.grid(number, step)
        header = p.GridHeader(
            scan=self.name,
            revision=state.revision,
            grid=number,
            laser=grid.laser,
            closed=grid.closed,
            orientation=self.session.scan.plan.orientation,
            causes=list(CAUSE_TEXTS),
        )
        return header, encoded(arrays)

    def profile(self, number: int, step: int) -> tuple[p.ProfileHeader, dict[str, Array]]:
        """The stripe of one step, and its candidates. Raises InputError, ScanCorrupt."""
        state, shown = self.session.profile(number, step)
        plan = self.session.scan.plan
        header = p.ProfileHeader(
            scan=self.name,
            revision=state.revision,
            grid=number,
            laser=shown.laser,
            step=step,
            angle_deg=shown.angle_deg,
            orientation=plan.orientation,
            width=plan.width,
            height=plan.height,
            threshold=plan.threshold,
            strategy=state.options.strategy,
            edited=shown.edited,
        )
        return header, encoded(shown.arrays)

    def picture(self, number: int, step: int) -> bytes:
        """The stored picture of a step as PNG. Raises InputError, ScanCorrupt."""
        return png(self.session.picture(number, step))

    # Repairing: until its result is stored, each may be cancelled, and then nothing has happened

    def make(
        self, base: int, value: Mapping[str, Any], arrays: Mapping[str, Array], job: Job
    ) -> None:
        """Make an edit: it is in the file when this returns. Raises as `ScanSession.make`."""
        self.session.make(base, value, arrays, job)

    def preview(
        self,
        base: int,
        value: Mapping[str, Any],
        arrays: Mapping[str, Array],
        id: int,
        job: Job,
    ) -> tuple[p.PreviewShown, dict[str, Array]]:
        """What an edit would do; nothing is kept. Raises as `make`."""
        shown = self.session.preview(base, value, arrays, job)
        return p.PreviewShown(id=id, figures=figures(shown.figures)), encoded(shown.arrays)

    def measure(self, request: q.TakeMeasure, arrays: Mapping[str, Array], job: Job) -> p.Measures:
        """Measure, and keep it in the history. Raises InputError where it cannot be measured."""
        self.session.measure(request.what, request.places, arrays, job)
        return self.measures(request.id)

    def forget_measure(self, id: int, name: str, job: Job) -> p.Measures:
        """Switch a measurement off. Raises InputError where there is none of that name."""
        self.session.forget_measure(_number(name), job)
        return self.measures(id)

    def specify(self, request: q.SpecifyMeasure, job: Job) -> p.Measures:
        """Name a measurement and give it limits. Raises InputError, FormatError."""
        said = request.name.strip(), request.nominal, request.lower, request.upper
        self.session.specify(_number(request.measure), *said, job)
        return self.measures(request.id)

    def measure_again(self, id: int, job: Job) -> p.Measures:
        """Take measurements again of which the surface was changed since."""
        if self.session.measure_again(job):
            self._hub.tell(self.measures(None))
        return self.measures(id)

    def measures(self, id: int | None) -> p.Measures:
        """What the measurements that count came to."""
        return p.Measures(id=id, scan=self.name, measures=_measures(self.now))

    def colours(self, id: int, job: Job) -> tuple[p.ColoursShown, dict[str, Array]]:
        """Colours from the texture images. Raises InputError where there are none."""
        state, arrays = self.session.colours(job.progress)
        answer = p.ColoursShown(id=id, scan=self.name, revision=state.revision)
        return answer, encoded(arrays)

    def deviation(
        self, request: q.ShowDeviation, reference: Item, table: Path | None, job: Job
    ) -> tuple[p.DeviationShown, dict[str, Array]]:
        """How far the surface lies from a reference. Raises InputError where it says nothing."""
        options = CompareOptions(
            reference_unit=request.unit, samples=1000, align=request.align, datums=request.datums,
            features=request.features,
        )  # fmt: skip
        state, shown = self.session.deviation(reference.path, options, table, job.progress)
        found = shown.comparison
        d = found.deviation
        answer = p.DeviationShown(
            id=request.id,
            scan=self.name,
            revision=state.revision,
            reference=reference.name,
            vertices=len(d.distance),
            mean=d.mean,
            rms=d.rms,
            p95=d.quantile(0.95),
            worst=d.quantile(1.0),
            alignment=found.placement.text,
            findings=remarks(
                [f for f in found.findings if f.code.startswith("compare.")], self._hub.hide
            ),
            features=[
                p.FeatureShown(
                    number=f.number, nominal=f.nominal, points=f.points, mean=f.mean, rms=f.rms
                )
                for f in found.features
            ],
            checks=[_check(c) for c in found.figures().get("checks", ())],
            verdict=found.verdict,
        )
        return answer, encoded({"distance": shown.distance})

    def try_settings(
        self, request: q.TrySettings, job: Job
    ) -> tuple[p.SettingsTried, dict[str, Array]]:
        """What settings make of a part of the scan. Raises InputError for what cannot be."""
        r = request
        _, trial = self.session.try_settings(r.options, r.grid, r.step, job.check)
        answer = p.SettingsTried(
            id=r.id, scan=self.name, laser=trial.laser,
            steps=[one.step for one in trial.profiles],
            findings=remarks(trial.findings, self._hub.hide),
        )  # fmt: skip
        return answer, encoded_parts(trial.arrays)

    def compare_settings(
        self, request: q.CompareSettings, job: Job
    ) -> tuple[p.SettingsCompared, dict[str, Array]]:
        """Two settings side by side. Raises InputError where one makes no surface."""
        r = request
        _, shown = self.session.compare_settings(r.first, r.second, r.gap, job.progress)
        d, areas = shown.comparison.deviation, shown.areas
        answer = p.SettingsCompared(
            id=r.id, scan=self.name, mean=d.mean, rms=d.rms, p95=d.quantile(0.95),
            worst=d.quantile(1.0), areas=(areas.reference, areas.measured), won=areas.won,
            lost=areas.lost,
        )  # fmt: skip
        return answer, encoded_parts(shown.arrays)

    def shapes(self, id: int, job: Job) -> tuple[p.ShapesShown, dict[str, Array]]:
        """The shapes of the surface. Raises InputError where there is nothing to fit."""
        state, shown = self.session.shapes(job.progress)
        table = shown.dimensions
        answer = p.ShapesShown(
            id=id,
            scan=self.name,
            revision=state.revision,
            shapes=[
                p.ShapeEntry(text=text, place=_vector(place), size=size)
                for text, place, size in zip(
                    shown.words, shown.places, shown.sizes.tolist(), strict=True
                )
            ],
            coverage=shown.found.found.coverage,
            relations=shown.relations,
            dimensions=p.ResultTable(
                title=table.title,
                head=list(table.head),
                rows=[[str(cell) for cell in row] for row in table.rows],
            ),
            findings=remarks(shown.found.findings, self._hub.hide),
        )
        return answer, encoded({"shape": shown.label})

    def touched(self) -> tuple[p.MeshHeader, dict[str, Array]]:
        """What was last done by hand at each vertex."""
        state, arrays = self.session.touched()
        return self._mesh_header(state), encoded(arrays)

    def quality(self) -> tuple[p.MeshHeader, dict[str, Array]]:
        """How well the region about each vertex is known."""
        state, arrays = self.session.quality()
        return self._mesh_header(state), encoded(arrays)

    def undo(self, job: Job) -> None:
        """One edit back. Raises InputError where there is none."""
        self.session.undo(job)

    def redo(self, job: Job) -> None:
        """One edit on again. Raises InputError where there is none."""
        self.session.redo(job)

    def go(self, id: int, job: Job) -> None:
        """To the state after an edit, of a branch too; 0: as scanned. Raises InputError."""
        self.session.go(id, job)

    def name_edit(self, id: int, name: str, job: Job) -> None:
        """Name an edit. Raises InputError where there is none of that number."""
        self.session.name_edit(id, name, job)

    def switch(self, id: int, on: bool, job: Job) -> None:
        """One edit off, or on again. Raises InputError where there is none of that number."""
        self.session.switch(id, on, job)

    # Telling

    def _tell(self, change: SessionChange) -> None:
        """Tell everybody what one step changed."""
        before, state = change.before, change.after
        parts, arrays = patch_parts(change.surface())
        self._hub.tell(
            p.Patch(
                scan=self.name,
                revision=state.revision,
                epoch=state.epoch,
                text=change.text,
                parts=parts,
                figures=figures(state.figures),
            ),
            arrays,
        )
        if before.measures != state.measures:
            self._hub.tell(p.Measures(id=None, scan=self.name, measures=_measures(state)))
        if before.options != state.options or before.sets != state.sets:
            self._tell_settings(state)
        for k, steps in change.grids():
            self._hub.tell(p.GridChanged(scan=self.name, grid=k, steps=steps))
        self._tell_history()
        self._draw(state)

    def _tell_history(self) -> None:
        with self._telling:
            state = self.now
            self._hub.tell(
                p.History(
                    scan=self.name,
                    history=self._entries(state),
                    cursor=state.document.history.cursor,
                    branches=self._branches(state),
                    scanned_picture=self._picture(self.session.picture_as_scanned()),
                )
            )

    def _draw(self, state: SessionState) -> None:
        """Draw the pictures that the history lacks, meanwhile; then everybody gets it with them."""
        wanted = self.session.step_pictures(state)
        self._pictures.draw(wanted, self._tell_history)

    def _picture(self, key: str) -> str:
        return key if self._pictures.has(key) else ""

    def _tell_settings(self, state: SessionState) -> None:
        self._hub.tell(
            p.SettingsChanged(
                scan=self.name,
                settings=self._settings(state),
                grids=_grid_entries(state),
                findings=remarks(self.findings, self._hub.hide),
            )
        )

    def _settings(self, state: SessionState) -> p.ScanSettings:
        sets = [
            p.SettingsSet(name=name, options=asdict(options))
            for name, options in state.sets.items()
        ]
        radius, low, high = self.session.volume
        return p.ScanSettings(
            options=asdict(state.options),
            volume=(
                radius,
                low if math.isfinite(low) else None,
                high if math.isfinite(high) else None,
            ),
            sets=sets,
        )

    def _entries(self, state: SessionState) -> list[p.HistoryEntry]:
        return [self._entry(k, row) for k, row in enumerate(self.session.history(state))]

    def _branches(self, state: SessionState) -> list[p.BranchEntry]:
        return [
            p.BranchEntry(
                after=branch.after, edits=[self._entry(k, row) for k, row in enumerate(branch.rows)]
            )
            for branch in self.session.branches(state)
        ]

    def _entry(self, index: int, row: HistoryRow) -> p.HistoryEntry:
        return p.HistoryEntry(
            index=index, edit=row.edit, name=row.kind, text=row.text, on=row.on, at=_iso(row.at),
            title=row.name, picture=self._picture(row.picture),
        )  # fmt: skip


def _grid_entries(state: SessionState) -> list[p.GridEntry]:
    return [
        p.GridEntry(
            grid=k,
            laser=g.laser,
            first_step=int(g.steps[0]) if len(g.steps) else 0,
            last_step=int(g.steps[-1]) if len(g.steps) else 0,
        )
        for k, g in enumerate(state.grids)
    ]


def _measures(state: SessionState) -> list[p.Measure]:
    return [
        p.Measure(
            measure=f"{_PREFIX}{m.edit}",
            what=m.what,
            value=m.value,
            unit=m.unit,
            uncertainty=m.uncertainty,
            places=list(m.places),
            text=m.text,
            name=m.name,
            nominal=m.nominal,
            lower=m.lower,
            upper=m.upper,
            verdict=m.verdict,
            outdated=m.outdated,
            noise=m.noise,
            shared=m.shared,
            complete=m.complete,
            doubt=m.doubt,
        )
        for m in state.measures
    ]


def _check(of: Mapping[str, Any]) -> p.SizeCheck:
    sigma = of["sigma"]
    return p.SizeCheck(
        features=of["features"],
        quantity=of["quantity"],
        nominal=of["nominal"],
        measured=of["measured"],
        uncertainty=2.0 * sigma if math.isfinite(sigma) else None,
        unit="°" if of["unit"] == "deg" else of["unit"],
        tolerance=of["tolerance"] or "",
        limits=of["limits"],
        verdict=of["verdict"] or "",
    )


def _number(measure: str) -> int:
    """The number of the edit that a measurement is. Raises InputError for no name of one."""
    number = measure.removeprefix(_PREFIX)
    if not (measure.startswith(_PREFIX) and number.isascii() and number.isdigit()):
        raise InputError("no such measurement")
    return int(number)


def _vector(point: np.typing.NDArray[np.float64]) -> p.Vector:
    return float(point[0]), float(point[1]), float(point[2])


def _iso(seconds: float) -> str:
    if math.isnan(seconds):
        return ""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")
