"""OpenScan: a scan file open for viewing and repairing; what it shows, and its edits as patches."""

from __future__ import annotations

import math
import re
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from turnscan import edit
from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._encode_grid import CAUSES, grid_arrays, picture_png, profile_arrays
from turnscan.app._encode_mesh import (
    coarse_arrays,
    figures,
    mesh_arrays,
    patch_parts,
    preview_arrays,
)
from turnscan.app._envelope import Array
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, remarks
from turnscan.app._measuring import entry_of, measure_of, measures
from turnscan.detection import detect_scan
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.meshing import finished, source_of
from turnscan.pipeline import Reconstruction, build
from turnscan.points import RangeGrid
from turnscan.progress import Progress
from turnscan.scan import Scan, rig_for
from turnscan.shapes import Source
from turnscan.stripes import named
from turnscan.surface.clean import settled
from turnscan.surface.holes import CAUSE_WORDS, Hole, ScanCoverage, explain, holes
from turnscan.workflows import ReconstructResult, about, kept_options

MOST_HOLES = 1000
"""The largest ones are progress."""


class Stale(InputError):
    """The edit was made on a surface that has changed since."""


@dataclass(frozen=True, eq=False)
class State:
    """What an open scan is at one moment; a value, so that readers need no lock."""

    document: edit.Document
    grids: tuple[RangeGrid, ...]
    sought: tuple[ScanCoverage, ...]
    """What the scan could have seen, for the causes of holes."""
    revision: int
    epoch: int
    figures: p.Figures


class OpenScan:
    """One scan, its document and its revisions. Readers take `now`; edits come one at a time."""

    def __init__(self, name: str, path: Path, hub: Hub, job: Job) -> None:
        """Reconstruct, and replay the edits in the file.

        Raises as `Scan.resume`, `detect_scan` and `build`, and Cancelled.
        """
        self.name, self.path, self._hub = name, path, hub
        self.used = time.monotonic()
        self._lock = threading.RLock()
        self._looking = threading.Lock()
        self._found: tuple[int, Mesh, list[Hole]] | None = None
        self._built: dict[tuple[edit.Entry, ...], Reconstruction] = {}
        self._times: dict[int, float] = {}
        self.scan = Scan.resume(path)
        try:
            rig = rig_for(self.scan)
            self._settings = kept_options(self.scan).settings(rig, self.scan)
            looking, building = job.progress.subrange(0, 0.8), job.progress.subrange(0.8, 1)
            stripes, volume = self._settings.stripes, self._settings.volume
            self._seen = detect_scan(
                self.scan, rig, stripes, volume, looking.counter(len(self.scan))
            )
            self._views = {s.view.laser: s.view for s in self._seen}
            log = self.scan.edits()
            history = edit.history_from_log([e.text for e in log], f"{path.name}: edits")
            for entry in log:
                action = edit.action_from_json(entry.text)
                if isinstance(action, edit.Add):
                    self._times[action.id] = entry.time
            document = edit.Document.open(self._build, history, building, self._source)
        except BaseException:
            self.scan.close()
            raise
        self.now = self._state(document, 0, 0)

    def close(self) -> None:
        """Let the file go."""
        with self._lock:
            self.scan.close()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be said about the scan and its edits."""
        s, found = self._settings, tuple(self.now.document.findings)
        if s.caps is None and s.tolerance is None and s.faces is None:
            return found
        done = "closed" if s.caps is not None else "decimated"
        text = f"the settings of this scan require its surface {done}: applied on export"
        return (*found, Finding("scan.finished-on-export", "note", text))

    def result(self, state: State, progress: Progress) -> ReconstructResult:
        """The surface as files get it: closed and decimated as the scan's settings say."""
        s = self._settings
        opened = edit.Compact.of(state.document.body).mesh
        mesh, found = finished(opened, s, progress)
        whole = settled(mesh)
        done = Reconstruction(
            state.grids,
            whole,
            tuple(found),
            state.document.history.enabled,
            whole if mesh is opened else opened,
            state.sought,
            s.caps,
            along=s.along,
            tears=s.tears,
        )
        rig = self._seen[0].view.rig
        return ReconstructResult(done, about(self.path, rig, s, done.edits), rig)

    # Seeing

    def opened(self, id: int | None) -> p.Opened:
        """Where it stands."""
        self.used = time.monotonic()
        state = self.now
        return p.Opened(
            id=id,
            scan=self.name,
            name=self.path.stem,
            revision=state.revision,
            epoch=state.epoch,
            steps=self.scan.plan.steps,
            grids=[
                p.GridEntry(
                    grid=k,
                    laser=g.laser,
                    first_step=int(g.steps[0]) if len(g.steps) else 0,
                    last_step=int(g.steps[-1]) if len(g.steps) else 0,
                )
                for k, g in enumerate(state.grids)
            ],
            figures=state.figures,
            history=self._entries(state),
            cursor=state.document.history.cursor,
            branches=self._branches(state),
            findings=remarks(self.findings),
            measures=measures(state.document),
        )

    def mesh(self) -> tuple[p.MeshHeader, dict[str, Array]]:
        """The whole surface."""
        state = self.now
        return self._mesh_header(state), mesh_arrays(state.document.body)

    def _mesh_header(self, state: State) -> p.MeshHeader:
        provenance = state.document.body.mesh.provenance
        return p.MeshHeader(
            scan=self.name,
            revision=state.revision,
            epoch=state.epoch,
            lasers=[] if provenance is None else list(provenance.lasers),
        )

    def holes(self, id: int) -> tuple[p.Holes, dict[str, Array]]:
        """Every hole with its cause, and its border."""
        state = self.now
        mesh, found = self._holes(state)
        entries = [
            p.HoleEntry(
                hole=k,
                size=h.size,
                perimeter=h.perimeter,
                area=h.area,
                centre=(float(h.centre[0]), float(h.centre[1]), float(h.centre[2])),
                cause=h.cause,
                cause_text=CAUSE_WORDS[h.cause or "unknown"],
            )
            for k, h in enumerate(found)
        ]
        loops = {f"loop_{k}": mesh.vertices[h.loop].astype("<f4") for k, h in enumerate(found)}
        answer = p.Holes(id=id, scan=self.name, revision=state.revision, holes=entries)
        return answer, loops

    def _holes(self, state: State) -> tuple[Mesh, list[Hole]]:
        """The largest first; kept until the surface changes."""
        with self._looking:
            if self._found is None or self._found[0] != state.revision:
                mesh = edit.Compact.of(state.document.body).mesh
                found = explain(mesh, holes(mesh), state.sought)
                found = sorted(found, key=lambda h: -h.size)[:MOST_HOLES]
                self._found = state.revision, mesh, found
            return self._found[1:]

    def defects(self, id: int) -> p.Defects:
        """What was found wrong, with its place where it has one, and the holes."""
        state = self.now
        progress = [_defect(f, state.grids) for f in state.document.findings]
        _, found = self._holes(state)
        for h in found:
            remark = p.Remark(
                code="surface.hole",
                severity="note",
                text=f"a hole of {h.size:.1f} mm: {CAUSE_WORDS[h.cause or 'unknown']}",
                where="",
                remedy="fill it, or scan the part in another pose as well",
            )
            place = (float(h.centre[0]), float(h.centre[1]), float(h.centre[2]))
            progress.append(p.Defect(remark=remark, place=place, grid=None, step=None, line=None))
        return p.Defects(id=id, scan=self.name, revision=state.revision, defects=progress)

    def stand_in(self, faces: int) -> tuple[p.MeshHeader, dict[str, Array]]:
        """A coarse surface of about so many faces."""
        state = self.now
        return self._mesh_header(state), coarse_arrays(state.document.body, faces)

    def grid(self, number: int, step: int | None) -> tuple[p.GridHeader, dict[str, Array]]:
        """A grid, or one step of it. Raises InputError for one there is not."""
        state = self.now
        grid = _numbered(state, number)
        header = p.GridHeader(
            scan=self.name,
            revision=state.revision,
            grid=number,
            laser=grid.laser,
            closed=grid.closed,
            orientation=self.scan.plan.orientation,
            causes=CAUSES,
        )
        return header, grid_arrays(grid, state.document.history.enabled, step)

    def profile(self, number: int, step: int) -> tuple[p.ProfileHeader, dict[str, Array]]:
        """The stripe of one step, and its candidates. Raises InputError, ScanCorrupt."""
        state, plan = self.now, self.scan.plan
        grid = _numbered(state, number)
        arrays = profile_arrays(self._views[grid.laser], grid, step)
        row = int(np.flatnonzero(grid.steps == step)[0])
        header = p.ProfileHeader(
            scan=self.name,
            revision=state.revision,
            grid=number,
            laser=grid.laser,
            step=step,
            angle_deg=math.degrees(float(grid.angles[row])),
            orientation=plan.orientation,
            width=plan.width,
            height=plan.height,
            threshold=plan.threshold,
            strategy=named(self._settings.stripes.strategy),
            edited=bool((arrays["chosen"] == -2).any()),
        )
        return header, arrays

    def picture(self, number: int, step: int) -> bytes:
        """The stored picture of a step as PNG. Raises InputError, ScanCorrupt."""
        return picture_png(self._views[_numbered(self.now, number).laser], step)

    # Edits: until its result is stored, each may be cancelled, and then nothing has happened

    def make(
        self, base: int, value: Mapping[str, Any], arrays: Mapping[str, Array], job: Job
    ) -> None:
        """Make an edit: it is in the file when this returns.

        Raises `Stale` where the surface is not that of revision ``base`` any more, InputError,
        Cancelled.
        """
        with self._lock:
            self._keep(*self._tried(base, value, arrays, job), job)

    def preview(
        self,
        base: int,
        value: Mapping[str, Any],
        arrays: Mapping[str, Array],
        id: int,
        job: Job,
    ) -> tuple[p.PreviewShown, dict[str, Array]]:
        """What an edit would do; nothing is kept. Raises as `make`."""
        with self._lock:
            before = self.now.document.body
            document, change = self._tried(base, value, arrays, job)
        job.commit()
        shown = p.PreviewShown(id=id, figures=figures(document.body))
        return shown, preview_arrays(before, document.body, change.patches)

    def measure(self, wish: q.TakeMeasure, arrays: Mapping[str, Array], job: Job) -> p.Measures:
        """Measure, and keep it in the history. Raises InputError where it cannot be measured."""
        with self._lock:
            document = self.now.document
            region = _region(document.body, arrays)
            document, change = document.add(measure_of(wish.what, wish.places, region))
            if change.findings:
                raise InputError(change.findings[0].message, hint=change.findings[0].remedy)
            self._keep(document, change, job)
            return self.measures(wish.id)

    def forget_measure(self, id: int, name: str, job: Job) -> p.Measures:
        """Switch a measurement off. Raises InputError where there is none of that name."""
        with self._lock:
            if name not in [m.measure for m in measures(self.now.document)]:
                raise InputError("no such measurement")
            self._keep(*self.now.document.switch(entry_of(name), False), job)
            return self.measures(id)

    def measures(self, id: int | None) -> p.Measures:
        """What the measurements that count came to."""
        return p.Measures(id=id, scan=self.name, measures=measures(self.now.document))

    def undo(self, job: Job) -> None:
        """One edit back. Raises InputError where there is none."""
        with self._lock:
            self._keep(*self.now.document.undo(job.progress), job)

    def redo(self, job: Job) -> None:
        """One edit on again. Raises InputError where there is none."""
        with self._lock:
            self._keep(*self.now.document.redo(job.progress), job)

    def go(self, cursor: int, job: Job) -> None:
        """To the state after the first ``cursor`` edits. Raises InputError."""
        with self._lock:
            self._keep(*self.now.document.go(cursor, job.progress), job)

    def branch(self, id: int, job: Job) -> None:
        """The branch that ends with this edit becomes the history. Raises InputError."""
        with self._lock:
            self._keep(*self.now.document.branch(id, job.progress), job)

    def switch(self, id: int, on: bool, job: Job) -> None:
        """One edit off, or on again. Raises InputError where there is none of that number."""
        with self._lock:
            self._keep(*self.now.document.switch(id, on, job.progress), job)

    def _tried(
        self, base: int, value: Mapping[str, Any], arrays: Mapping[str, Array], job: Job
    ) -> tuple[edit.Document, edit.Change]:
        job.check()  # while it waited for the edit before it
        if base != self.now.revision:
            raise Stale(
                "another edit changed the surface meanwhile; this one was not made",
                hint="check the surface, then repeat",
            )
        wish = dict(value)
        region = _region(self.now.document.body, arrays)
        if region is not None:
            wish["where"] = region
        wanted = edit.edit_from_value(wish)
        job.title = edit.describe(wanted)
        document, change = self.now.document.add(wanted, job.progress)
        refused = next((f for f in change.findings if f.severity == "error"), None)
        if refused is not None:
            raise InputError(refused.message, hint=refused.remedy)
        if not (change.patches or edit.needs_rebuild(wanted) or edit.is_measure(wanted)):
            said = "; ".join(f.message for f in change.findings)
            raise InputError(said or f"{edit.describe(wanted)} changes nothing here")
        return document, change

    def _keep(self, document: edit.Document, change: edit.Change, job: Job) -> None:
        """Into the file first, then to everybody. Raises Cancelled, and then into neither."""
        job.commit()
        self.used = time.monotonic()
        if change.action is not None:
            now = time.time()
            self.scan.append_edit(edit.action_to_json(change.action), now)
            if isinstance(change.action, edit.Add):
                self._times[change.action.id] = now
        before = self.now
        replaced = any(isinstance(c, edit.Replace) for c in change.patches)
        state = self._state(document, before.revision + 1, before.epoch + replaced)
        self.now = state
        parts, arrays = patch_parts(change.patches)
        self._hub.tell(
            p.Patch(
                scan=self.name,
                revision=state.revision,
                epoch=state.epoch,
                text=_what(change.action, document.history),
                parts=parts,
                figures=state.figures,
            ),
            arrays,
        )
        if measures(before.document) != measures(document):
            self._hub.tell(self.measures(None))
        for k, steps in _changed(before.grids, state.grids):
            self._hub.tell(p.GridChanged(scan=self.name, grid=k, steps=steps))
        self._hub.tell(
            p.History(
                scan=self.name,
                history=self._entries(state),
                cursor=document.history.cursor,
                branches=self._branches(state),
            )
        )

    def _entries(self, state: State) -> list[p.HistoryEntry]:
        return [
            p.HistoryEntry(
                index=k,
                edit=e.id,
                name=e.edit.kind,
                text=edit.describe(e.edit),
                on=e.on,
                at=_iso(self._times.get(e.id, math.nan)),
            )
            for k, e in enumerate(state.document.history.entries)
        ]

    def _branches(self, state: State) -> list[p.BranchEntry]:
        history = state.document.history
        here = {e.id for e in history.entries}
        return [
            p.BranchEntry(
                edit=path[-1].id,
                edits=sum(e.id not in here for e in path),
                text=edit.describe(path[-1].edit),
                at=_iso(self._times.get(path[-1].id, math.nan)),
            )
            for path in history.branches
        ]

    def _build(
        self, entries: Sequence[edit.Entry], progress: Progress
    ) -> tuple[Mesh, Sequence[Finding]]:
        done = build(self._seen, self._settings, entries, progress, finish=False)
        self._built[tuple(entries)] = done
        return done.mesh, done.findings

    def _source(self) -> Source:
        """What the surface was made from that was built last."""
        last = list(self._built.values())[-1]
        return source_of(last.grids, self._seen[0].view.rig)

    def _state(self, document: edit.Document, revision: int, epoch: int) -> State:
        """What stands now; of what was built, only this is kept, for a preview builds, too."""
        entries = tuple(e for e in document.history.enabled if edit.needs_rebuild(e.edit))
        done = self._built[entries]
        self._built = {entries: done}
        return State(document, done.grids, done.sought, revision, epoch, figures(document.body))


def _region(body: edit.Body, arrays: Mapping[str, Array]) -> edit.Region | None:
    """The faces that came with a request, as numbers or as a bit for each.

    Raises InputError where they are none of the surface.
    """
    for name in ("faces", "face_bits"):
        if name in arrays and (arrays[name].dtype.kind != "u" or arrays[name].ndim != 1):
            raise InputError(f"{name}: not a list of numbers")
    if "face_bits" in arrays:
        bits = np.unpackbits(arrays["face_bits"].astype(np.uint8), bitorder="little")
        return edit.Region.of(body, np.flatnonzero(bits))
    return edit.Region.of(body, arrays["faces"]) if "faces" in arrays else None


def _defect(finding: Finding, grids: Sequence[RangeGrid]) -> p.Defect:
    """A finding, and the step and the grid that its words name."""
    words = f"{finding.where}: {finding.message}"
    step = re.search(r"\bsteps? (\d+)", words)
    grid = None
    for k, g in enumerate(grids):
        if re.search(rf"\blaser '?{re.escape(g.laser)}\b", words):
            number = int(step[1]) if step else None
            if number is None or number in g.steps:
                grid = k
                break
    return p.Defect(
        remark=remarks([finding])[0],
        place=None,
        grid=grid,
        step=int(step[1]) if step else None,
        line=None,
    )


def _numbered(state: State, number: int) -> RangeGrid:
    if not 0 <= number < len(state.grids):
        raise InputError(f"there is no grid {number}")
    return state.grids[number]


def _changed(
    before: Sequence[RangeGrid], after: Sequence[RangeGrid]
) -> Iterator[tuple[int, list[int]]]:
    """Which steps of which grids are others now."""
    for k, (a, b) in enumerate(zip_longest(before, after)):
        if a is b or b is None:
            continue
        if a is None or not np.array_equal(a.steps, b.steps):
            yield k, b.steps.tolist()
            continue
        same = ((a.points == b.points) | (np.isnan(a.points) & np.isnan(b.points))).all(axis=(1, 2))
        same &= (a.flags == b.flags).all(axis=1)
        if not same.all():
            yield k, b.steps[~same].tolist()


def _what(action: edit.Action | None, history: edit.History) -> str:
    match action:
        case edit.Add():
            return edit.describe(action.edit)
        case edit.Switch():
            return f"edit {action.id} switched {'on' if action.on else 'off'}"
        case edit.Branch():
            return f"branch of {len(history.entries)} edits taken up"
        case edit.Go():
            return f"{action.cursor} of {len(history.entries)} edits"
        case None:
            return ""


def _iso(seconds: float) -> str:
    if math.isnan(seconds):
        return ""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")
