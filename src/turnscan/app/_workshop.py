"""Workshop: what the server is, put together; every request from a socket is answered here."""

from __future__ import annotations

import contextlib
import gc
import logging
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from turnscan import __version__
from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._calibrate_session import CalibrateRoom, verifications
from turnscan.app._downloads import Downloads
from turnscan.app._envelope import Array
from turnscan.app._files import Files
from turnscan.app._gallery import OWN
from turnscan.app._hub import Client, Hub
from turnscan.app._import_session import ImportRoom
from turnscan.app._jobs import Job, Jobs, Result, options_of, remarks
from turnscan.app._library import Library
from turnscan.app._open_scan import OpenScan
from turnscan.app._request_guard import name_of
from turnscan.app._rig_session import RigRoom
from turnscan.app._scan_session import ScanRoom
from turnscan.app._start_session import StartRoom
from turnscan.app._step_pictures import StepPictures
from turnscan.app._uploads import Uploads
from turnscan.app._verbs import list_verbs, run_verb
from turnscan.errors import InputError, SafetyError, TurnscanError
from turnscan.memory import give_back
from turnscan.progress import Cancelled
from turnscan.remedy import plain_words
from turnscan.workflows import EditChanges, NotOpen, Stale, edits, read_rig_file

_log = logging.getLogger("turnscan.app")
_FILES = ("folder", "video")
"""Kinds of cameras that read files."""
_OPEN_SCANS = 4
"""Documents that are held open at a time."""
_CLOSING = 60.0
"""s that a document may take to be closed before what waits for it is refused."""
_OPEN_FACES = 1_000_000
"""Triangles of all documents that stay open while another one is opened, some 200 bytes each."""


Answer = p.Model | tuple[p.Model, Mapping[str, Array]] | None
"""A message, perhaps with arrays; None for done."""


@dataclass(frozen=True)
class Call:
    """A request on its way to an answer."""

    client: Client
    request: Any
    arrays: Mapping[str, Array]

    @property
    def id(self) -> int:
        """The number that the client gave it."""
        number: int = self.request.id
        return number


class Refusal(TurnscanError):
    """A request that is not done, with a code of the protocol's own."""

    def __init__(self, code: str, message: str, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.code = code


class Workshop:
    """Everything behind the doors."""

    def __init__(self, library: Library, *, remote_lasers: bool = False) -> None:
        self.library, self.remote_lasers = library, remote_lasers
        self.hub = Hub()
        self.hub.hide = library.hide
        self.jobs = Jobs(self.hub)
        self.downloads = Downloads()
        self.files = Files(library)
        self.uploads = Uploads(self.files.incoming, library.check_upload)
        self.importing = ImportRoom(self.files, library.hide)
        self.rig = RigRoom(self.hub, self.jobs, library, self._operator_may_light)
        self.taking = ScanRoom(self.hub, self.jobs, library, self.rig, self.tell_scans)
        self.calibration = CalibrateRoom(self.hub, self.jobs, library, self.rig)
        self.unsafe: SafetyError | None = None
        """What `close` raised."""
        self._scans: dict[str, OpenScan] = {}
        self._opening: dict[str, Job] = {}
        self._first: dict[str, tuple[p.FirstSurface, Mapping[str, Array]]] = {}
        """What is shown of scans that are being opened, where there is something already."""
        self._leaving: dict[str, tuple[OpenScan, threading.Event]] = {}
        """Documents that are closed to make room, until they are."""
        self._trials: dict[str, tuple[int, Job]] = {}
        """The trial of settings of each browser, and the number of the request."""
        self._lock = threading.RLock()
        self._telling = threading.Lock()
        """The lists that were sent last are those of the folders at present."""
        self._pool = ThreadPoolExecutor(8, "request")
        self.pictures = StepPictures(library.folder / OWN)
        self.start = StartRoom(self.jobs, library, self._release, self.tell_results)
        self._answers = self._answer_table()

    def _answer_table(self) -> dict[type, tuple[Callable[[Call], Answer], bool]]:
        """How each kind of request is answered, and whether only the operator may ask."""
        return {
            q.Stop: (self._stop, False),
            q.TakeControl: (self._take_control, False),
            q.ReleaseControl: (self._release_control, False),
            q.Cancel: (self._cancel, True),
            q.Open: (self._open, False),
            **self.start.answers(),
            q.ShowFolder: (self._show_folder, True),
            q.ListVerbs: (lambda call: list_verbs(call.id), False),
            q.ListFiles: (lambda call: p.Files(id=call.id, files=self.files.entries()), False),
            q.RunVerb: (self._run_verb, True),
            q.PreviewImport: (lambda call: self.importing.preview(call.request), True),
            q.EditRequest: (self._edit, True),
            q.Undo: (self._undo, True),
            q.Redo: (self._redo, True),
            q.GoTo: (self._go_to, True),
            q.NameEdit: (self._name_edit, True),
            q.Switch: (self._switch, True),
            q.CopyEdits: (self._copy_edits, True),
            q.TrySettings: (self._try_settings, False),
            q.CompareSettings: (self._compare_settings, False),
            q.ListHoles: (self._list_holes, False),
            q.ListDefects: (
                lambda call: self.opened(call.request.scan).defects(call.id),
                False,
            ),
            q.TakeMeasure: (self._take_measure, True),
            q.ForgetMeasure: (self._forget_measure, True),
            q.SpecifyMeasure: (self._specify, True),
            q.MeasureAgain: (self._measure_again, False),
            q.ShowDeviation: (self._show_deviation, False),
            q.ShowColours: (self._show_colours, False),
            q.FindShapes: (self._find_shapes, False),
            q.SaveReport: (self._save_report, True),
            q.FindDevices: (self._find_devices, True),
            q.Connect: (self._connect, True),
            q.Disconnect: (lambda call: self.rig.disconnect(), True),
            q.Look: (self._look, True),
            q.Turn: (lambda call: self.rig.turn(call.request.angle_deg), True),
            q.Doctor: (self._doctor, True),
            q.UseRig: (self._use_rig, True),
            q.BeginCalibration: (lambda call: self.calibration.begin(call.request), True),
            q.Capture: (self._capture, True),
            q.ForgetView: (lambda call: self.calibration.forget(call.request.view), True),
            q.FinishCalibration: (self._finish_calibration, True),
            q.ListVerifications: (
                lambda call: verifications(call.id, self.library.history_file),
                False,
            ),
            q.StartScan: (self._scan, True),
            q.Resume: (self._resume, True),
            q.Pause: (lambda call: self.taking.pause(), True),
            q.GoOn: (self._go_on, True),
            q.Abort: (lambda call: self.taking.abort(), True),
        }

    # What the socket calls

    def greet(self, client: Client) -> None:
        """Send a client its first message."""
        with self._telling:
            self.hub.tell(self._hello(client), to=client)

    def _hello(self, client: Client) -> p.Hello:
        operator = self.hub.operator
        return p.Hello(
            protocol=p.VERSION,
            version=__version__,
            client=client.id,
            operator=None if operator is None else operator.id,
            scans=self.entries(),
            binned=self.start.gallery.binned(),
            lasers_allowed=self.may_light(client),
            can_show_folder=not client.remote,
        )

    def answer(self, client: Client, request: Any, arrays: Mapping[str, Array]) -> None:
        """Answer a request, sooner or later; a stop at once, whatever others wait for."""
        call = Call(client, request, arrays)
        if isinstance(request, q.Stop):
            threading.Thread(target=self._answer, args=(call,), name="stop", daemon=True).start()
        else:
            self._pool.submit(self._answer, call)

    def close(self) -> None:
        """End everything that is under way, lasers dark.

        Raises SafetyError, as the last thing, where they may be lit still.
        """
        with contextlib.suppress(TurnscanError):  # what it cannot do `close` meets, too
            self.rig.stop()
        try:
            self.jobs.close()
        finally:
            try:
                self.rig.close()
            finally:
                self._put_away()

    def _put_away(self) -> None:
        self.pictures.close()
        self.start.close()
        self._pool.shutdown(wait=True, cancel_futures=True)
        with self._lock:
            scans = list(self._scans.values())
            self._scans.clear()
        for scan in scans:
            self._put_back(scan)
        self.downloads.close()
        self.files.close()

    # What routes call

    def stop(self, client: str | None = None) -> None:
        """Lasers dark, table still; every browser learns who did it. Raises as `RigRoom.stop`."""
        confirmed = False
        try:
            self.rig.stop()
            confirmed = True
        finally:
            self.hub.tell(p.Stopped(client=client, confirmed=confirmed))

    def may_light(self, client: Client) -> bool:
        """Whether this client may light a laser."""
        return not client.remote or self.remote_lasers

    def entries(self) -> list[p.ScanEntry]:
        """The list of scan files."""
        return self.library.entries(self._open_names())

    def _open_names(self) -> frozenset[str]:
        with self._lock:
            return frozenset(self._scans)

    def opened(self, name: str) -> OpenScan:
        """A scan that is open. Raises NotOpen where it is not, InputError where there is none."""
        with self._lock:
            scan = self._scans.get(name)
        if scan is None:
            self.library.path(name)
            raise NotOpen("this scan is not open", hint="open it first")
        return scan

    def tell_scans(self) -> None:
        """Tell everybody the list of scan files."""
        with self._telling:
            self.hub.tell(p.Scans(scans=self.entries(), binned=self.start.gallery.binned()))

    def tell_files(self) -> None:
        """Tell everybody the list of files for verbs."""
        with self._telling:
            self.hub.tell(p.Files(id=None, files=self.files.entries()))

    def tell_results(self) -> None:
        """Tell everybody what a verb has written."""
        self.tell_scans()
        self.tell_files()

    # Answers

    def _answer(self, call: Call) -> None:
        client, request = call.client, call.request
        try:
            work, operators = self._answers[type(request)]
            if operators and self.hub.operator is not client:
                raise Refusal("not-operator", "another browser is the operator", "take control")
            answer = work(call)
        except Refusal as e:
            self._refuse(call, e.code, e)
        except Stale as e:
            self._refuse(call, "stale", e)
        except Cancelled:
            self._refuse(call, "cancelled", InputError("cancelled; nothing was changed"))
        except TurnscanError as e:
            self._refuse(call, name_of(e), e)
        except Exception as e:  # noqa: BLE001 the door: whatever is left is our mistake
            _log.error("internal error (%s) in %s", type(e).__name__, request.kind)
            mistake = InputError("internal error", hint="please report it")
            self._refuse(call, "mistake", mistake)
        else:
            message, arrays = answer if isinstance(answer, tuple) else (answer, None)
            self.hub.tell(message or p.Done(id=call.id), arrays, to=client)

    def _refuse(self, call: Call, code: str, e: TurnscanError) -> None:
        text, hint = self.hub.hide(e.message), self.hub.hide(plain_words(e.hint))
        self.hub.tell(
            p.Refused(id=call.id, code=code, text=text, hint=hint, options=options_of(e)),
            to=call.client,
        )

    @contextlib.contextmanager
    def _editing(self, call: Call, title: str) -> Iterator[tuple[OpenScan, Job]]:
        """The open scan of a request that may take long, and what can be cancelled of it."""
        scan = self.opened(call.request.scan)
        with self.jobs.perhaps("edit", title, scan.name) as job:
            yield scan, job

    def _take_measure(self, call: Call) -> Answer:
        with self._editing(call, "Measuring") as (scan, job):
            return scan.measure(call.request, call.arrays, job)

    def _forget_measure(self, call: Call) -> Answer:
        with self._editing(call, "Deleting a measurement") as (scan, job):
            return scan.forget_measure(call.id, call.request.measure, job)

    def _specify(self, call: Call) -> Answer:
        with self._editing(call, "Writing a dimension") as (scan, job):
            return scan.specify(call.request, job)

    def _measure_again(self, call: Call) -> Answer:
        with self._editing(call, "Measuring again") as (scan, job):
            return scan.measure_again(call.id, job)

    def _show_deviation(self, call: Call) -> Answer:
        r: q.ShowDeviation = call.request
        reference = self.files.find(r.reference)
        table = None if r.tolerance_table is None else self.files.find(r.tolerance_table).path
        with self._editing(call, f"Comparing with {reference.name}") as (scan, job):
            return scan.deviation(r, reference, table, job)

    def _show_colours(self, call: Call) -> Answer:
        with self._editing(call, "Colouring the surface") as (scan, job):
            return scan.colours(call.id, job)

    def _find_shapes(self, call: Call) -> Answer:
        with self._editing(call, "Finding shapes") as (scan, job):
            return scan.shapes(call.id, job)

    def _try_settings(self, call: Call) -> Answer:
        """The newest trial of a browser alone goes on; other browsers do not hear of it."""
        r: q.TrySettings = call.request
        scan = self.opened(r.scan)
        job = Job(self.hub, "edit", "Trying settings", scan.name, shown=False)
        with self._lock:
            number, before = self._trials.get(call.client.id, (0, job))
            if number > r.id:  # that thread was faster
                raise Cancelled
            self._trials[call.client.id] = r.id, job
        if before is not job:
            before.cancel()
        try:
            return scan.try_settings(r, job)
        finally:
            job.over = True
            with self._lock:
                if self._trials.get(call.client.id) == (r.id, job):
                    del self._trials[call.client.id]

    def _compare_settings(self, call: Call) -> Answer:
        with self._editing(call, "Comparing two settings") as (scan, job):
            return scan.compare_settings(call.request, job)

    def _save_report(self, call: Call) -> p.Model:
        r: q.SaveReport = call.request
        scan, path = self.opened(r.scan), self.library.new_file(r.name, r.suffix)

        def work(job: Job) -> Result:
            found = scan.session.save_report(path, job.progress)
            self.tell_results()
            file = p.ResultFile(file=self.library.name_of(path), name=path.name, scan=False)
            return Result("\n".join(found.summary()), files=[file])

        return p.StartedJob(id=call.id, job=self.jobs.start("verb", path.name, work, r.scan).id)

    def _operator_may_light(self) -> bool:
        operator = self.hub.operator
        return operator is not None and self.may_light(operator)

    def _check_lasers(self, call: Call) -> None:
        if not self.may_light(call.client):
            raise Refusal(
                "no-lasers",
                "lasers cannot be lit from another computer",
                "start turnscan with --allow-remote-lasers, only with the laser area secured",
            )

    def _stop(self, call: Call) -> None:
        self.stop(call.client.id)

    def _find_devices(self, call: Call) -> p.Model:
        return self.rig.find(call.id, call.request.probe)

    def _connect(self, call: Call) -> None:
        r: q.Connect = call.request
        if call.client.remote:
            _check_remote(r.camera, r.turntable, r.lasers)
        self.rig.connect(r.camera, r.turntable, r.lasers)

    def _look(self, call: Call) -> None:
        r: q.Look = call.request
        if not r.on:
            self.rig.look_off()
            return
        if r.lit:
            self._check_lasers(call)
        self.rig.look(r)

    def _doctor(self, call: Call) -> p.Model:
        self._check_lasers(call)
        job = self.rig.doctor(call.request.still, call.request.seconds)
        return p.StartedJob(id=call.id, job=job.id)

    def _use_rig(self, call: Call) -> None:
        path = self.library.rigs().get(call.request.name)
        if path is None:
            raise InputError("no such rig file", hint="reload the list")
        rig = read_rig_file(path)
        if rig.lacking:
            missing = " and ".join(rig.lacking)
            raise InputError(f"{path.name}: {missing} of this rig is not calibrated yet")
        self.rig.use_rig(rig, path.name)

    def _capture(self, call: Call) -> p.Model:
        if call.request.stage == "laser" or call.request.laser is not None:
            self._check_lasers(call)
        return p.StartedJob(id=call.id, job=self.calibration.capture(call.request).id)

    def _finish_calibration(self, call: Call) -> p.Model:
        return p.StartedJob(id=call.id, job=self.calibration.finish(call.request).id)

    def _scan(self, call: Call) -> p.Model:
        self._check_lasers(call)
        return p.StartedJob(id=call.id, job=self.taking.start(call.request.plan).id)

    def _resume(self, call: Call) -> p.Model:
        self._check_lasers(call)
        name = call.request.scan
        path = self.library.path(name)
        _ = self.rig.connected  # before the document is closed
        self._release(name)  # a scan file has one writer
        return p.StartedJob(id=call.id, job=self.taking.resume(path, call.request).id)

    def _go_on(self, call: Call) -> None:
        self._check_lasers(call)
        self.taking.go_on()

    def _take_control(self, call: Call) -> None:
        self.hub.take(call.client)

    def _release_control(self, call: Call) -> None:
        self.hub.release(call.client)

    def _cancel(self, call: Call) -> None:
        if not self.jobs.cancel(call.request.job):
            raise InputError("no such job")

    def _open(self, call: Call) -> p.Model:
        name = call.request.scan
        path = self.library.path(name)
        with self._lock:
            if name in self._scans:
                return self._scans[name].opened(call.id)
            if name not in self._opening:
                leaving = self._to_close()
                title = f"Opening {path.stem}"
                self._opening[name] = self.jobs.start(
                    "open", title, lambda job: self._load(job, name, path, leaving), name
                )
            if name in self._first:
                self.hub.tell(*self._first[name], to=call.client)
            return p.StartedJob(id=call.id, job=self._opening[name].id)

    def _load(self, job: Job, name: str, path: Path, leaving: Sequence[str]) -> Result:
        def show(message: p.FirstSurface, arrays: Mapping[str, Array]) -> None:
            with self._lock:
                self._first[name] = message, arrays
                self.hub.tell(message, arrays)

        try:
            self._make_room(leaving)
            self._await_leaving(name)
            scan = OpenScan(name, path, self.hub, job, self.pictures, show)
            with self._lock:
                self._scans[name] = scan
        finally:
            give_back()
            with self._lock:
                self._opening.pop(name, None)
                self._first.pop(name, None)
        self.hub.tell(scan.opened(None))
        self.start.gallery.keep(path, scan.thumbnail(), scan.findings)
        self.tell_scans()
        return Result(f"{path.stem} is open", findings=scan.findings)

    def _to_close(self) -> list[str]:
        """The documents that make room for another, those not used for the longest; none of them
        is open any more. Raises Refusal where others are being opened in all places."""
        if len(self._opening) >= _OPEN_SCANS:
            raise Refusal("busy", "other scans are being opened", "wait until they are open")
        leaving = list[str]()
        while len(self._scans) + len(self._opening) >= _OPEN_SCANS or self._faces() > _OPEN_FACES:
            name = min(self._scans, key=lambda n: self._scans[n].used)
            self._leaving[name] = self._scans.pop(name), threading.Event()
            leaving.append(name)
        return leaving

    def _faces(self) -> int:
        return sum(scan.now.figures.faces for scan in self._scans.values())

    def _make_room(self, leaving: Sequence[str]) -> None:
        if not leaving:
            return
        with contextlib.ExitStack() as each:  # one that fails keeps no other from being closed
            for name in leaving:
                each.callback(self._put_back_leaving, name)
        _give_back_all()

    def _put_back_leaving(self, name: str) -> None:
        try:
            self._put_back(self._leaving[name][0])
        finally:
            with self._lock:
                self._leaving.pop(name)[1].set()

    def _await_leaving(self, name: str) -> None:
        """Wait until a document that makes room is closed: a scan file has one writer.

        Raises Refusal where that takes too long.
        """
        with self._lock:
            leaving = self._leaving.get(name)
        if leaving is not None and not leaving[1].wait(_CLOSING):
            raise Refusal("busy", "this scan is being closed", "repeat this in a moment")

    def _release(self, name: str) -> None:
        """Close the document of a scan, where there is one. Raises Refusal while it is opened."""
        self._await_leaving(name)
        with self._lock:
            if name in self._opening:
                raise Refusal("busy", "this scan is being opened", "wait until it is open")
            if name in self._leaving:
                raise Refusal("busy", "this scan is being closed", "repeat this in a moment")
            document = self._scans.pop(name, None)
        if document is not None:
            self._put_back(document)
            del document
            _give_back_all()
            self.hub.tell(p.Closed(scan=name))

    def _put_back(self, document: OpenScan) -> None:
        """Close a document; what it looks like is kept for the list."""
        changed = document.now.revision > 0
        try:
            shown = (document.thumbnail(), document.findings) if changed else None
        finally:
            document.close()
        if shown is not None:
            self.start.gallery.keep(document.path, *shown)

    def _show_folder(self, call: Call) -> None:
        if call.client.remote:
            raise Refusal("not-remote", "the folder is on another computer", "download the files")
        self.start.show_folder()

    def thumbnail(self, name: str) -> bytes:
        """A small picture of a scan as PNG. Raises InputError and ScanError where there is none."""
        path = self.library.path(name)
        with self._lock:
            document = self._scans.get(name)
        return self.start.gallery.thumbnail(path) if document is None else document.thumbnail()

    def _run_verb(self, call: Call) -> p.Model:
        job = run_verb(self.jobs, self.library, self.files, call.request, self.tell_results)
        return p.StartedJob(id=call.id, job=job.id)

    def _edit(self, call: Call) -> Answer:
        r: q.EditRequest = call.request
        with self._editing(call, "Editing") as (scan, job):
            if r.preview:
                return scan.preview(r.base_revision, r.edit, call.arrays, call.id, job)
            scan.make(r.base_revision, r.edit, call.arrays, job)
        return None

    def _undo(self, call: Call) -> None:
        with self._editing(call, "Undo") as (scan, job):
            scan.undo(job)

    def _redo(self, call: Call) -> None:
        with self._editing(call, "Redo") as (scan, job):
            scan.redo(job)

    def _go_to(self, call: Call) -> None:
        with self._editing(call, "Replaying the history") as (scan, job):
            scan.go(call.request.edit, job)

    def _name_edit(self, call: Call) -> None:
        with self._editing(call, "Naming an edit") as (scan, job):
            scan.name_edit(call.request.edit, call.request.name, job)

    def _switch(self, call: Call) -> None:
        with self._editing(call, "Enabling or disabling an edit") as (scan, job):
            scan.switch(call.request.edit, call.request.on, job)

    def _copy_edits(self, call: Call) -> p.Done:
        r: q.CopyEdits = call.request
        source, target = self.library.path(r.scan), self.library.path(r.to)
        if source == target:
            raise InputError("this is the scan itself", hint="choose another one")
        with self.jobs.perhaps("edit", "Copying edits", r.scan) as job:
            self._release(r.to)
            wanted = EditChanges(source, only=r.edits, by_shape=r.by_shape, check=True)
            kept = edits(target, wanted, progress=job.progress)
        self.tell_scans()
        return p.Done(id=call.id, findings=remarks(kept.findings, self.hub.hide))

    def _list_holes(self, call: Call) -> Answer:
        return self.opened(call.request.scan).holes(call.id, call.request.first)


def _give_back_all() -> None:
    """Have the system get back what closed documents held: each refers to itself."""
    gc.collect()
    give_back()


def _check_remote(*addresses: str) -> None:
    """Raise Refusal for addresses that name files of this computer."""
    for address in addresses:
        scheme, _, rest = address.partition(":")
        scene = rest.partition("?")[0]
        if scheme in _FILES or (scheme == "sim" and not scene.replace("-", "").isalnum()):
            raise Refusal(
                "not-remote",
                f"{scheme}: names a file, which a remote browser may not",
                "connect it from the computer that turnscan runs on",
            )
