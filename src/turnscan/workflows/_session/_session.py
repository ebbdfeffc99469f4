"""ScanSession: a scan file open for viewing and repairing, with its settings, edits and revisions.

What a browser shows, without a word of how it is told: values and arrays out, edits in.
"""

from __future__ import annotations

import contextlib
import re
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan import edit
from turnscan.detection import Detection, detect_scan
from turnscan.errors import FormatError, InputError, ScanNewer, TurnscanError
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.meshing import finished, source_of
from turnscan.picture import png
from turnscan.pipeline import Reconstruction, build
from turnscan.points import RangeGrid, Volume, working_volume
from turnscan.progress import Progress
from turnscan.scan import Scan, lit_in, rig_for
from turnscan.settings import Settings
from turnscan.shapes import Source
from turnscan.stripes import StripeSettings
from turnscan.surface import mesh_findings
from turnscan.surface.clean import settled
from turnscan.surface.holes import Hole, explain, holes
from turnscan.workflows._compile_ahead import compiling_ahead
from turnscan.workflows._files._history import history_of, repairs
from turnscan.workflows._files._kept_options import (
    DEFAULT_SET,
    check_set_edit,
    checked_edit,
    edit_in_words,
    kept_names,
    kept_options,
)
from turnscan.workflows._inspection._measure import Measured, measure
from turnscan.workflows._inspection._shapes import find_shapes
from turnscan.workflows._options._compare import CompareOptions
from turnscan.workflows._options._declare import chosen
from turnscan.workflows._options._reconstruct import ReconstructOptions
from turnscan.workflows._session._deviation import ShownDeviation, shown_deviation
from turnscan.workflows._session._first import first_surface
from turnscan.workflows._session._gallery import THUMBNAIL
from turnscan.workflows._session._grid import (
    ShownProfile,
    grid_arrays,
    shown_profile,
    touched,
)
from turnscan.workflows._session._history import BranchRow, HistoryRow, Steps, step_in_words
from turnscan.workflows._session._measures import (
    Place,
    Renewed,
    What,
    measure_of,
    measures_of,
    named_table,
    renewed,
)
from turnscan.workflows._session._mesh import (
    Arrays,
    coarse_arrays,
    preview_arrays,
    surface_arrays,
)
from turnscan.workflows._session._nothing import Left, nothing_made
from turnscan.workflows._session._settings import ShownSettings, shown_settings
from turnscan.workflows._session._shapes import ShownShapes, shown_shapes
from turnscan.workflows._session._state import (
    NotOpen,
    PlacedFinding,
    SessionChange,
    SessionState,
    ShownPreview,
    Stale,
    Work,
)
from turnscan.workflows._session._trial import Trial, Way, found_anew, found_before, tried
from turnscan.workflows._surface._quality_map import has_sigmas, sigmas
from turnscan.workflows._surface._reconstruct import reconstruct
from turnscan.workflows._surface._report import about
from turnscan.workflows._surface._result import ReconstructResult
from turnscan.workflows._surface._texture import TextureSource, coloured, colours

MOST_HOLES = 1000
"""So many are reported at once."""
_MOST_DETECTIONS = 3
"""Stripes found with other settings that are held, so that undo does not look for them again."""
_PICTURED = 150_000
"""Triangles that a small picture shows at most: several for each of its pixels."""
_EPOCH_BITS = 52
"""Of the number that a session's epochs begin with, so that no two sessions of a scan share one;
the protocol and the browsers' numbers have one more."""
_DETECTION = 0.8
"""Of the work of opening a scan, until all stripes are found."""


class ScanSession:
    """One scan, its document and its revisions. Readers take `now`; edits come one at a time."""

    def __init__(
        self,
        path: Path,
        progress: Progress,
        changed: Callable[[SessionChange], None] = lambda change: None,
        first: Callable[[int, int, Arrays], None] | None = None,
    ) -> None:
        """Reconstruct, and replay the edits in the file; ``changed`` hears of every later step.

        ``first`` gets what can be shown meanwhile, where this takes long (`FirstSurface`).

        Raises as `Scan.resume`, `detect_scan` and `build`, and Cancelled.
        """
        self.path, self._changed = path, changed
        self.used = time.monotonic()
        self._lock = threading.RLock()
        self._closed = False
        self._looking = threading.Lock()
        self._found: tuple[int, Mesh, list[Hole]] | None = None
        self._said: tuple[int, tuple[Finding, ...]] | None = None
        self._known: tuple[edit.Body | None, Renewed] = None, Renewed()
        """A surface, and what is known of the measurements on it."""
        self._built: dict[tuple[int, ...], Reconstruction] = {}
        """What was built, by the numbers of the edits that it was built with."""
        self._seen: dict[tuple[StripeSettings, Volume | None], list[Detection]] = {}
        self._current: tuple[StripeSettings, Volume | None] | None = None
        """Of the stripes that `now` is made of."""
        self.scan = Scan.resume(path)
        try:
            self._rig, self._steps = rig_for(self.scan), Steps(str(self.scan.digest))
            for entry in self.scan.edits():
                action = edit.action_from_json(entry.text)
                if isinstance(action, edit.Add):
                    self._steps.made(action.id, entry.time)
            history = history_of(self.scan)
            with compiling_ahead():
                if first is not None:
                    self._show_first(history, first, progress)
                rest = self._prepared(history, progress)
                document = edit.Document.open(self._build, history, rest, self._source)
            self.now = self._state(document, 0, secrets.randbits(_EPOCH_BITS))
        except BaseException:
            self.scan.close()
            raise

    def close(self) -> None:
        """Let the file go."""
        with self._lock:
            self._closed = True
            self.scan.close()

    @contextlib.contextmanager
    def _open(self) -> Iterator[None]:
        """The scan, for one alone. Raises NotOpen where it was closed while one waited."""
        with self._lock:
            if self._closed:
                raise NotOpen(
                    "this scan was closed meanwhile; nothing was changed", hint="open it again"
                )
            yield

    def touch(self) -> None:
        """It is in use."""
        self.used = time.monotonic()

    # Seeing

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be said about the scan and its edits."""
        s, found = self.now.settings, self._findings(self.now)
        if s.caps is None and s.tolerance is None and s.faces is None:
            return found
        done = "closed" if s.caps is not None else "decimated"
        text = f"the settings of this scan require its surface {done}: applied on export"
        return (*found, Finding("scan.finished-on-export", "note", text))

    def result(self, state: SessionState, progress: Progress) -> ReconstructResult:
        """The surface as files get it: closed and decimated as the scan's settings say."""
        s = state.settings
        opened = edit.Compact.of(state.document.body).mesh
        mesh, found = finished(opened, s, progress)
        whole = settled(mesh)
        if mesh is not opened:
            found += mesh_findings(whole, 0, 0, closed=s.caps is not None)
        if s.caps is not None:
            found += Source(state.grids, surface=state.merged).findings(whole)
        shown = whole
        if not state.options.no_colour:
            shown, said = coloured(whole, [TextureSource(self.scan, self._rig)], progress)
            found = [*found, *said]
        done = Reconstruction(
            state.grids,
            shown,
            tuple(found),
            repairs(state.document.history.enabled),
            whole if mesh is opened else opened,
            state.sought,
            s.caps,
            along=s.along,
            tears=s.tears,
            cut=state.document.cut(),
            lost=state.lost,
            merged=state.merged,
        )
        told = about(self.path, self._rig, s, done.edits)
        return ReconstructResult(done, told, self._rig, options=state.options)

    def surface(self) -> tuple[SessionState, Arrays]:
        """The whole surface (`surface_arrays`), and what it is of."""
        state = self.now
        return state, surface_arrays(state.document.body)

    @property
    def volume(self) -> tuple[float, float, float]:
        """Radius, lowest and largest height of the rig's own working volume, mm."""
        own = [
            working_volume(self._rig, name)
            for lit in self.scan.plan.lasers
            for name in lit_in(lit, self._rig)
        ]
        low, high = min(v.z_min for v in own), max(v.z_max for v in own)
        return max(v.r_max for v in own), low, high

    @property
    def textured(self) -> bool:
        """Whether there are texture pictures, which `colours` takes the colours from."""
        return bool(self.scan.texture_angles)

    def colours(self, progress: Progress) -> tuple[SessionState, Arrays]:
        """``colour`` (v, 3) of each vertex there is a number for, from the texture pictures.

        Raises InputError where there are none, ScanCorrupt, Cancelled.
        """
        state = self.now
        body = state.document.body
        mesh = replace(
            body.mesh, faces=body.mesh.faces[body.alive], measured=body.measured[body.alive]
        )
        found, _ = colours(mesh, [TextureSource(self.scan, self._rig)], progress)
        if found is None:
            raise InputError(
                f"{self.path.name}: no texture images", hint="scan with texture images"
            )
        return state, {"colour": found.colour}

    def coarse(self, faces: int) -> tuple[SessionState, Arrays]:
        """A surface of about so many faces: ``positions``, ``faces``."""
        state = self.now
        return state, coarse_arrays(state.document.body, faces)

    def thumbnail(self) -> bytes:
        """A small picture of the surface as PNG, shaded, on a transparent ground."""
        body = self.now.document.body
        if np.count_nonzero(body.alive) > _PICTURED:
            few = coarse_arrays(body, _PICTURED)
            mesh = Mesh(few["positions"], few["faces"])
        else:
            mesh = edit.Compact.of(body).mesh
        return png(mesh.show(size=THUMBNAIL, transparent=True).pixels)

    def holes(
        self, first: int = 0
    ) -> tuple[SessionState, int, list[tuple[Hole, npt.NDArray[np.float64]]]]:
        """How many holes there are, and `MOST_HOLES` at most from the ``first`` on, the largest
        first, each with its border (m, 3) mm.
        """
        state = self.now
        mesh, found = self._holes(state)
        some = found[first : first + MOST_HOLES]
        return state, len(found), [(h, mesh.vertices[h.loop]) for h in some]

    def defects(self) -> tuple[SessionState, list[PlacedFinding | Hole]]:
        """What was found wrong, and then the largest holes, `MOST_HOLES` at most."""
        state = self.now
        _, found = self._holes(state)
        said = [_placed(f, state.grids) for f in self._findings(state)]
        return state, [*said, *found[:MOST_HOLES]]

    def grid(self, number: int, step: int | None) -> tuple[SessionState, RangeGrid, Arrays]:
        """A grid, or one step of it (`grid_arrays`). Raises InputError for one there is not."""
        state = self.now
        grid = _numbered(state, number)
        return state, grid, grid_arrays(grid, state.document, step)

    def profile(self, number: int, step: int) -> tuple[SessionState, ShownProfile]:
        """The stripe of one step, and its candidates. Raises InputError, ScanCorrupt."""
        state = self.now
        grid = _numbered(state, number)
        return state, shown_profile(state.views[grid.laser], grid, step)

    def picture(self, number: int, step: int) -> npt.NDArray[Any]:
        """The stored picture of a step, lit. Raises InputError, ScanCorrupt."""
        view = self.now.views[_numbered(self.now, number).laser]
        return self.scan.frame(step, view.lit).lit

    def history(self, state: SessionState) -> list[HistoryRow]:
        """The edits in their order; the first ``cursor`` of them count."""
        return self._steps.rows(state.document.history.entries)

    def branches(self, state: SessionState) -> list[BranchRow]:
        """The other pieces of the tree of edits, the newest first."""
        return self._steps.branches(state.document.history)

    def picture_as_scanned(self) -> str:
        """Names the picture of the surface before any edit."""
        return self._steps.pictures(())[0]

    def step_pictures(self, state: SessionState) -> Iterator[tuple[str, Callable[[], bytes]]]:
        """Pictures that can be drawn of steps up to the present one: names, and what draws them.

        The newest first, back to the last step that made the surface anew.
        """
        return self._steps.drawn(state.document)

    def touched(self) -> tuple[SessionState, Arrays]:
        """``touch`` (v,): what was last done by hand at each vertex, a number of `Touch`.

        4 where its point of the scan grid was moved, added or picked.
        """
        state = self.now
        return state, {"touch": touched(state.document, state.grids)}

    def quality(self) -> tuple[SessionState, Arrays]:
        """``sigma`` (v,) mm, of the region about each vertex as in reports (`sigmas`), or NaN."""
        state = self.now
        part = edit.Compact.of(state.document.body)
        sigma = np.full(len(state.document.body.mesh.vertices), np.nan)
        if has_sigmas(part.mesh):
            sigma[part.vertex_ids] = sigmas(part.mesh)
        return state, {"sigma": sigma}

    # Repairing: until its result is stored, each may be cancelled, and then nothing has happened

    def make(
        self, base: int, value: Mapping[str, Any], faces: Mapping[str, npt.NDArray[Any]], work: Work
    ) -> None:
        """Make an edit: it is in the file when this returns.

        ``faces`` names the faces it acts on: ``faces`` by number, or ``face_bits``, a bit for each.
        Raises `Stale` where the surface is not that of revision ``base`` any more, InputError,
        Cancelled.
        """
        with self._open():
            self._keep(*self._tried(base, value, faces, work), work)

    def preview(
        self, base: int, value: Mapping[str, Any], faces: Mapping[str, npt.NDArray[Any]], work: Work
    ) -> ShownPreview:
        """What an edit would do; nothing is kept. Raises as `make`."""
        with self._open():
            before = self.now.document.body
            document, change = self._tried(base, value, faces, work)
        work.commit()
        shown = preview_arrays(before, document.body, change.patches)
        return ShownPreview(edit.figures(document.body), shown)

    def measure(
        self,
        what: What,
        places: Sequence[Place],
        faces: Mapping[str, npt.NDArray[Any]],
        work: Work,
    ) -> None:
        """Measure, and keep it in the history. Raises InputError where it cannot be measured."""
        with self._open():
            document = self.now.document
            region = _region(document.body, faces)
            document, change = document.add(measure_of(what, places, region))
            if change.findings:
                raise InputError(change.findings[0].message, hint=change.findings[0].remedy)
            self._keep(document, change, work)
        self.measure_again(work)

    def forget_measure(self, number: int, work: Work) -> None:
        """Switch a measurement off. Raises InputError where no measurement has this number."""
        with self._open():
            if number not in [m.edit for m in self.now.measures]:
                raise InputError("no such measurement")
            self._keep(*self.now.document.switch(number, False), work)

    def specify(
        self,
        number: int,
        name: str,
        nominal: float | None,
        lower: float | None,
        upper: float | None,
        work: Work,
    ) -> None:
        """Name a measurement and give it limits (`edit.Specify`). Raises InputError, FormatError.

        InputError where no measurement has this number.
        """
        wanted = edit.Specify(number, name, nominal, lower, upper)
        with self._open():
            if wanted.measure not in [m.edit for m in self.now.measures]:
                raise InputError("no such measurement")
            self._keep(*self.now.document.add(wanted), work)

    def measure_again(self, work: Work) -> bool:
        """Bring the measurements up to date with the surface, and their uncertainties with what the
        calibration leaves open; whether there was anything to do.

        They are of the surface as it is until it changes; the history keeps them as they were.
        """
        with self._open():
            state = self.now
            if not any(m.outdated or not m.complete for m in state.measures):
                return False
            known = renewed(state.document, self._known_of(state.document), work.check)
            self._known = state.document.body, known
            self.now = replace(state, measures=measures_of(state.document, known))
            return True

    def _known_of(self, document: edit.Document) -> Renewed | None:
        """What is known of its measurements; None where the surface is another."""
        body, known = self._known
        return known if body is document.body else None

    def save_report(self, path: Path, progress: Progress) -> Measured:
        """Measure every size, and write the report: the kept measurements first, then all sizes.

        ``path`` ends with .html, .pdf, .json or .csv. Raises ExportError, InputError.
        """
        state = self.now
        document = state.document
        known = renewed(document, self._known_of(document), lambda: progress(0))
        result = self.result(state, progress.subrange(0, 0.3))
        found = measure(result, sizes=True, progress=progress.subrange(0.3, 1))
        found.save_report(path, named_table(measures_of(document, known)))
        return found

    def deviation(
        self,
        reference: Path,
        options: CompareOptions,
        tolerance_table: Path | None,
        progress: Progress,
    ) -> tuple[SessionState, ShownDeviation]:
        """How far the surface lies from a mesh or scan. Raises as `shown_deviation`."""
        state = self.now
        found = shown_deviation(
            state.document.body, lambda: self.result(state, progress.subrange(0, 0.3)), reference,
            options, tolerance_table, progress.subrange(0.3, 1),
        )  # fmt: skip
        return state, found

    def try_settings(
        self,
        options: Mapping[str, Any],
        number: int,
        step: int | None,
        check: Callable[[], None],
    ) -> tuple[SessionState, Trial]:
        """What settings make of the profile of a step, of others, and of the patch about it.

        Nothing is kept, and edits go on meanwhile. ``step`` None takes the middle one; ``check``
        raises Cancelled to end it. Raises InputError for settings that cannot be.
        """
        typed = chosen(ReconstructOptions, None, options)
        wanted = typed.settings(self._rig, self.scan)
        state = self.now
        grid = _numbered(state, number)
        rows = np.flatnonzero(grid.steps == step)
        row = int(rows[0]) if len(rows) else len(grid.steps) // 2
        seen = self._seen.get((state.settings.stripes, state.settings.volume))
        if seen is None or not len(grid.steps):
            raise InputError("the surface was changed meanwhile", hint="try again")
        known = self._seen.get((wanted.stripes, wanted.volume))
        find = (
            found_anew(seen, self.scan, self._rig, wanted, check)
            if known is None
            else found_before(known)
        )
        rebuilt = [e for e in state.document.history.enabled if edit.needs_rebuild(e.edit)]
        at = grid.laser, float(grid.angles[row])
        before = Way(state.options, state.settings, found_before(seen))
        after = Way(typed, wanted, find)
        return state, tried(seen, at, before, after, repairs(rebuilt), self.scan, check)

    def compare_settings(
        self,
        first: Mapping[str, Any],
        second: Mapping[str, Any],
        gap: float,
        progress: Progress,
    ) -> tuple[SessionState, ShownSettings]:
        """The surfaces that two settings make, with all edits, and how far they lie apart.

        ``gap`` mm as in `Areas`. Raises InputError for settings that cannot be, or make no surface.
        """
        state = self.now
        wanted = [chosen(ReconstructOptions, None, options) for options in (first, second)]
        a, b = (
            self._made_with(state, options, progress.subrange(k * 0.4, k * 0.4 + 0.4))
            for k, options in enumerate(wanted)
        )
        return state, shown_settings(a, b, gap, progress.subrange(0.8, 1))

    def _made_with(
        self, state: SessionState, options: ReconstructOptions, progress: Progress
    ) -> ReconstructResult:
        if options == state.options:
            return self.result(state, progress)
        entries = state.document.history.enabled
        return reconstruct(self.scan, options, edits=entries, progress=progress)

    def shapes(self, progress: Progress) -> tuple[SessionState, ShownShapes]:
        """The shapes that the surface is made of. Raises as `find_shapes`."""
        state = self.now
        result = self.result(state, progress.subrange(0, 0.3))
        found = find_shapes(result, progress=progress.subrange(0.3, 1))
        return state, shown_shapes(state.document.body, found)

    def undo(self, work: Work) -> None:
        """One edit back. Raises InputError where there is none."""
        self._step(lambda history: history.undo(), work)

    def redo(self, work: Work) -> None:
        """One edit on again. Raises InputError where there is none."""
        self._step(lambda history: history.redo(), work)

    def go(self, id: int, work: Work) -> None:
        """To the state after an edit, of the history or a branch; 0: as scanned. Raises InputError.

        A branch becomes the history, and what was the history a branch.
        """
        self._step(lambda history: history.to(id), work)

    def name_edit(self, id: int, name: str, work: Work) -> None:
        """Name an edit, of a branch too. Raises InputError where there is none of that number."""
        self._step(lambda history: history.naming(id, name), work)

    def switch(self, id: int, on: bool, work: Work) -> None:
        """One edit off, or on again. Raises InputError where there is none of that number."""
        self._step(lambda history: history.switch(id, on), work)

    def _step(self, action: Callable[[edit.History], edit.Action], work: Work) -> None:
        with self._open():
            history = self.now.document.history
            wanted = action(history)
            if history.is_at(wanted):
                return  # nothing to keep: whoever edits meanwhile is not told that all has changed
            self._keep(*self._after(wanted, work.progress), work)

    def _after(self, action: edit.Action, progress: Progress) -> tuple[edit.Document, edit.Change]:
        document = self.now.document
        rest = self._prepared(document.history.after(action), progress)
        return document.after(action, rest)

    def _tried(
        self, base: int, value: Mapping[str, Any], faces: Mapping[str, npt.NDArray[Any]], work: Work
    ) -> tuple[edit.Document, edit.Change]:
        work.check()  # while it waited for the edit before it
        if base != self.now.revision:
            raise Stale(
                "another edit changed the surface meanwhile; this one was not made",
                hint="check the surface, then repeat",
            )
        asked = dict(value)
        region = _region(self.now.document.body, faces)
        if region is not None:
            asked["where"] = region
        wanted = checked_edit(edit.edit_from_value(asked))
        words = work.title = edit_in_words(wanted)
        if isinstance(wanted, edit.ChangeSettings) and self._in_use(wanted):
            raise InputError("these settings are in use", hint="change one of them")
        check_set_edit(self.scan, self.now.document.history.enabled, wanted)
        document, change = self._after(self.now.document.history.add(wanted), work.progress)
        # Settings are refused where they make no surface, not where an edit cannot be done on it.
        settings = isinstance(wanted, edit.ChangeSettings)
        said_of = document.remarks if settings else change.findings
        refused = next((f for f in said_of if f.severity == "error"), None)
        if settings and not document.body.alive.any():
            refused = self._nothing_of(document)
        if refused is not None:
            raise InputError(refused.message, hint=refused.remedy)
        still = edit.is_measure(wanted) or edit.is_written(wanted)
        if not (change.patches or edit.needs_rebuild(wanted) or still):
            said = "; ".join(f.message for f in change.findings)
            raise InputError(said or f"{words} changes nothing here")
        return document, change

    def _nothing_of(self, document: edit.Document) -> Finding:
        """Why the settings of a document leave no face."""
        entries = document.history.enabled
        options, s = self._options(entries)
        numbers = tuple(e.id for e in entries if edit.needs_rebuild(e.edit))
        found = [d.stripes.stripes for d in self._seen[s.stripes, s.volume]]
        shown = sum(bool(stripe.found.any()) for stripes in found for stripe in stripes)
        left = Left.of(sum(map(len, found)), shown, self._built[numbers].grids)
        return nothing_made(left, self.now.options, options)

    def _in_use(self, wanted: edit.ChangeSettings) -> bool:
        return ReconstructOptions(**wanted.options) == self.now.options  # type: ignore[arg-type]

    def _keep(self, document: edit.Document, change: edit.Change, work: Work) -> None:
        """Into the file first, then to everybody. Raises Cancelled, and then into neither."""
        work.commit()
        self.touch()
        if change.action is not None:
            now = time.time()
            self.scan.append_edit(edit.action_to_json(change.action), now)
            if isinstance(change.action, edit.Add):
                self._steps.made(change.action.id, now)
        before = self.now
        replaced = any(isinstance(c, edit.Replace) for c in change.patches)
        self.now = self._state(document, before.revision + 1, before.epoch + replaced)
        text = step_in_words(change.action, document.history)
        self._changed(SessionChange(before, self.now, text, change.patches))

    # Reconstructing

    def _options(self, entries: Sequence[edit.Entry]) -> tuple[ReconstructOptions, Settings]:
        options = kept_options(self.scan, edits=entries)
        return options, options.settings(self._rig, self.scan)

    def _show_first(
        self, history: edit.History, show: Callable[[int, int, Arrays], None], progress: Progress
    ) -> None:
        with contextlib.suppress(TurnscanError):  # what is wrong the whole says
            _, s = self._options(history.enabled)
            found = first_surface(self.scan, self._rig, s, history, lambda: progress(0))
            if found is not None:
                show(found.every, found.edits, found.arrays)

    def _prepared(self, history: edit.History, progress: Progress) -> Progress:
        """Find the stripes that a history needs and that are not at hand; the work that is left."""
        _, s = self._options(history.enabled)
        if (s.stripes, s.volume) in self._seen:
            return progress
        self._detected(s, progress.subrange(0, _DETECTION, "finding the stripes"))
        return progress.subrange(_DETECTION, 1)

    def _detected(self, s: Settings, progress: Progress) -> list[Detection]:
        """The stripes that these settings find; those used last are kept."""
        key = s.stripes, s.volume
        seen = self._seen.pop(key, None)
        if seen is None:
            tick = progress.counter(len(self.scan))
            seen = detect_scan(self.scan, self._rig, s.stripes, s.volume, tick)
        self._seen[key] = seen
        idle = [k for k in self._seen if k not in (key, self._current)]
        for old in idle[: max(0, len(self._seen) - _MOST_DETECTIONS)]:
            del self._seen[old]
        return seen

    def _build(
        self, entries: Sequence[edit.Entry], progress: Progress
    ) -> tuple[Mesh, Sequence[Finding]]:
        _, s = self._options(entries)
        done = build(self._detected(s, progress), s, entries, progress, finish=False)
        self._built[tuple(e.id for e in entries)] = done
        return done.mesh, done.findings

    def _source(self) -> Source:
        """What the surface was made from that was built last."""
        last = list(self._built.values())[-1]
        return source_of(last.grids, self._rig, last.merged)

    def _state(self, document: edit.Document, revision: int, epoch: int) -> SessionState:
        """What stands now; of what was built, only this is kept, for a preview builds, too."""
        entries = tuple(e for e in document.history.enabled if edit.needs_rebuild(e.edit))
        numbers = tuple(e.id for e in entries)
        done = self._built[numbers]
        self._built = {numbers: done}
        options, s = self._options(entries)
        self._current = s.stripes, s.volume
        views = {d.view.laser: d.view for d in self._seen[self._current]}
        return SessionState(
            document, done.grids, done.sought, done.lost, done.merged, revision, epoch,
            edit.figures(document.body), options, s, views,
            measures_of(document, self._known_of(document)), self._sets(document),
        )  # fmt: skip

    def _sets(self, document: edit.Document) -> dict[str, ReconstructOptions]:
        sets = dict[str, ReconstructOptions]()
        made = document.history.enabled
        with contextlib.suppress(FormatError, ScanNewer):
            for name in kept_names(self.scan, made):
                with contextlib.suppress(FormatError, ScanNewer):
                    if name != DEFAULT_SET:
                        sets[name] = kept_options(self.scan, name, made)
        return sets

    def _findings(self, state: SessionState) -> tuple[Finding, ...]:
        """What is to be said; of borders and soundness, as they are after the edits."""
        document = state.document
        if not document.done:
            return document.findings
        if self._said is None or self._said[0] != state.revision:
            before, after = (
                mesh_findings(settled(edit.Compact.of(body).mesh), 0, 0)
                for body in (document.base, document.body)
            )
            kept = tuple(f for f in document.findings if f not in before)
            self._said = state.revision, (*kept, *after)
        return self._said[1]

    def _holes(self, state: SessionState) -> tuple[Mesh, list[Hole]]:
        """The largest first; kept until the surface changes."""
        with self._looking:
            if self._found is None or self._found[0] != state.revision:
                mesh = edit.Compact.of(state.document.body).mesh
                found = explain(mesh, holes(mesh), state.sought, state.document.cut(), state.lost)
                found = sorted(found, key=lambda h: -h.size)
                self._found = state.revision, mesh, found
            return self._found[1:]


def _region(body: edit.Body, arrays: Mapping[str, npt.NDArray[Any]]) -> edit.Region | None:
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


def _placed(finding: Finding, grids: Sequence[RangeGrid]) -> PlacedFinding:
    words = f"{finding.where}: {finding.message}"
    step = re.search(r"\bsteps? (\d+)", words)
    number = int(step[1]) if step else None
    grid = None
    for k, g in enumerate(grids):
        named = re.search(rf"\blaser '?{re.escape(g.laser)}\b", words)
        if named and (number is None or number in g.steps):
            grid = k
            break
    return PlacedFinding(finding, grid, number)


def _numbered(state: SessionState, number: int) -> RangeGrid:
    if not 0 <= number < len(state.grids):
        raise InputError(f"there is no grid {number}")
    return state.grids[number]
