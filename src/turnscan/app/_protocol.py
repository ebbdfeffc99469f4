"""The protocol between server and browser; `frontend/src/protocol.ts` is generated from this file.

One WebSocket at ``/ws`` carries everything that happens; plain GETs carry what is large and rests.

- A message is a JSON object with the key ``kind``. A text frame is such an object. A binary frame
  is an envelope (`turnscan.app._envelope`): the object as the header, and arrays behind it. The
  bodies of binary GETs are envelopes too.
- A request has an ``id`` that the client chooses. It is answered once, to its sender, by ``done``,
  by ``refused`` with words for a person, or by the message that its class names; the answer has
  the same ``id``. A job answers ``started`` and then reports to everybody.
- One client is the operator: it alone may edit, move and light. All others watch. Anybody may
  send ``stop``. ``take_control`` makes the sender the operator, and the one before learns it.
- An open scan is a document with an ``epoch`` and a ``revision``. Within an epoch vertices and
  faces keep their numbers: they are appended and cut off at the end, and faces die and come back.
  A patch is what one edit did, in one message, to everybody, in order; ``revision`` counts by one.
  Who has missed one, or sees ``replace``, gets the mesh again.
- An edit names the ``base_revision`` it was made on. Where that is not the latest one it is
  refused with the code ``stale``, and nothing has happened. When an edit is answered by ``done``
  it is in the scan file.
- An edit (preview, undo, measurement …) that takes longer than half a second is also told as a job
  of the kind ``edit``, until its request is answered. Cancelled before its result is stored, the
  request is refused with the code ``cancelled``, and nothing has happened: filling, smoothing and
  replaying end between two holes, rounds and edits, all else is computed to its end and dropped.
  Once it is stored, ``cancel`` does nothing.
- Faces and vertices in an edit are numbers of the document's own, in arrays of the envelope.
- Lengths are mm, angles in names that say so degrees, else rad; times s; pixels as (u, v).

Binary GETs, under ``/api/scans/{scan}/``:

- ``mesh``: header `MeshHeader`; positions f32 (v, 3), faces u32 (f, 3) of the living and the dead,
  alive u8 (f), measured u8 (f), sigma f32 (v) NaN where not measured, laser i32 (v), step i32 (v),
  line i32 (v), the last three −1 where not measured. ``mesh?faces=N`` is a stand-in of about N
  faces for moving: positions, faces.
- ``grid/{grid}``: header `GridHeader`; steps i32 (s), angles f32 (s), points f32 (s, n, 3) NaN
  where missing, sigma and amplitude f32 (s, n), flags u16 (s, n) (`turnscan.stripes.StripeFlag`),
  cause u8 (s, n) index into ``causes``, edited u8 (s, n) (0 as measured, 1 moved or picked,
  2 deleted, 3 added), off u8 (s). ``grid/{grid}?step=K`` is that step alone.
- ``profile/{grid}/{step}``: header `ProfileHeader`; position f32 (n), the stripe as it is used now,
  candidates f32 (n, K), candidate_amplitude f32 (n, K), candidate_points f32 (n, K, 3), all NaN
  where there is none, chosen i8 (n): −1 none, −2 a person's own place.
- ``edits``: header `MeshHeader`; touch u8 (v), what was last done by hand at each vertex:
  0 nothing, 1 moved, 2 added, 3 faces about it deleted, 4 its point changed in the grid.
- ``steps/{picture}.png``: the surface after an edit, small.
- ``picture/{grid}/{step}.png``: the picture as it was stored, lit; what was not kept is black.

``grid`` is the number of a `GridEntry`.
POST ``/api/scans`` (a scan file as the body, ``?name=``) adds a file; POST
``/api/scans/{scan}/exports`` with `ExportRequest` starts a job whose ``download`` is then at
``/api/downloads/{download}``. POST ``/api/files`` (any other file as the body, ``?name=``, and
``into=`` the set of an answer before) keeps a file, or what is in a zip, for verbs: `Received`; GET
``/api/files/{file}`` is a file, ``/api/files/{file}/page`` a report as a page. A large file goes
in pieces: POST ``/api/uploads`` (``?bytes=`` in all) begins it, POST ``/api/uploads``
(``?upload=&at=``, a piece as the body) adds a piece, GET ``/api/uploads/{upload}`` says how much is
here, all `Uploaded`; ``?upload=`` then stands for the body of the POSTs above. GET
``/api/calibration/{view}.jpg`` is a picture of the calibration, small; GET ``/api/target.pdf``
(``?board=&paper=``) a board to print. Requests that change something need the header
``X-Turnscan: 1``.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

VERSION = 1
"""Of the protocol; the page reloads itself where it has another one."""

Name = Annotated[str, Field(min_length=1, max_length=200)]
Opaque = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{4,64}$")]
"""A name that the server gave, and that means nothing outside of it."""
Count = Annotated[int, Field(ge=0, lt=2**53)]
Vector = tuple[float, float, float]
Box = tuple[Vector, Vector]


class Model(BaseModel):
    """Strict: nothing unknown, no NaN, and never changed."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


# What is told


class Remark(Model):
    """A finding, in words."""

    code: str
    severity: Literal["note", "warning", "error"]
    text: str
    where: str
    remedy: str
    options: list[RemedyOption] = []
    """Those that the remedy names."""


class RemedyOption(Model):
    """An option that a remedy or an error names, by the name in the verb's schema."""

    name: str
    value: str | None
    """As it is written in a field; None where no value is meant."""


class FileEntry(Model):
    """A file, or a folder of pictures, that verbs may take or have written."""

    file: Opaque
    name: str
    kinds: list[str]
    """What it can be to a verb, as ``accepts`` in schemas; empty for a result that none takes."""
    pictures: Count
    """Of a folder."""
    megabytes: float
    modified: str
    """ISO time, UTC."""
    sent: bool
    """Whether a browser sent it: it goes when the server ends."""
    takers: list[str]
    """Verbs that take it."""


class ResultFile(Model):
    """A file that a verb wrote into the folder."""

    file: Opaque
    name: str
    scan: bool
    """Whether it is a scan, to be opened as such; others are at ``/api/files/{file}``."""


class ResultTable(Model):
    """What a verb found out, as a table."""

    title: str
    head: list[str]
    rows: list[list[str]]


class VerbEntry(Model):
    """A verb that the server runs: ``run_verb``."""

    verb: str
    title: str
    group: str
    json_schema: dict[str, Any]
    """JSON Schema (draft 2020-12) of its values: `turnscan.workflows.Verb`."""


class FindingCounts(Model):
    """How many findings a scan has."""

    errors: Count
    warnings: Count
    notes: Count


class ScanEntry(Model):
    """A scan file in the list; its picture is at ``/api/scans/{scan}/thumbnail.png``, the file at
    ``/api/scans/{scan}/file``."""

    scan: Opaque
    name: str
    megabytes: float
    modified: str
    """ISO time, UTC."""
    open: bool
    missing: Count
    """Steps that ``resume`` would take; 0 where the scan is whole, or it cannot be resumed."""
    content: str
    """Other where its frames, edits or settings are others; empty where it cannot be read."""
    findings: FindingCounts | None
    """As it was when it was last open; None where it was not, or has changed since."""


class BinEntry(Model):
    """A scan in the bin."""

    binned: Opaque
    name: str
    megabytes: float
    at: str
    """ISO time of its deletion, UTC."""


class LaserState(Model):
    """What is known of a laser. Where dark is not confirmed, show it as lit."""

    name: str
    lit: bool | None
    """None: not known."""
    age_seconds: float
    """Since it was confirmed."""


class DeviceState(Model):
    """A camera or a turntable."""

    state: Literal["none", "ready", "busy", "failed"]
    text: str


class HistoryEntry(Model):
    """An edit in the list."""

    index: Count
    """Its place in the list: it counts where that is below the cursor, and it is on."""
    edit: Count
    """Its number for ever."""
    name: str
    text: str
    on: bool
    at: str
    """ISO time, UTC."""
    title: str
    """Name that a person gave it; empty for none."""
    picture: str
    """Of the surface after it, at ``/api/scans/{scan}/steps/{picture}.png``; empty for none."""


class BranchEntry(Model):
    """A piece of another history, left when an edit was made after stepping back."""

    after: Count
    """Number of the edit it grows from; 0: it begins with the first edit."""
    edits: list[HistoryEntry]
    """Those that neither the history nor a newer branch has."""


class HoleEntry(Model):
    """A hole in the surface. Its border is the array ``loop_{hole}``, f32 (m, 3)."""

    hole: Count
    size: float
    perimeter: float
    area: float
    centre: Vector
    cause: str | None
    cause_text: str


class Defect(Model):
    """A remark with its place on the part and in the scan, where it has one."""

    remark: Remark
    place: Vector | None
    grid: Count | None
    step: Count | None
    line: Count | None


class Measure(Model):
    """A measurement that is kept with the scan."""

    measure: Opaque
    what: str
    value: float
    unit: Literal["mm", "mm²", "mm³", "°"]
    uncertainty: float | None
    """k = 2."""
    places: list[Vector]
    text: str
    name: str = ""
    """That of the dimension, where it has one."""
    nominal: float | None = None
    lower: float | None = None
    """Limits of the deviation from the nominal value."""
    upper: float | None = None
    verdict: Literal["pass", "fail", "undecided"] | None = None
    """By ISO 14253-1, with the uncertainty; None without limits, or where outdated; undecided where
    in doubt."""
    outdated: bool = False
    """The surface was changed since it was measured."""
    noise: float | None
    """Standard uncertainty from the points' noise; of a volume that from all causes."""
    shared: float | None
    """Standard uncertainty from the calibration, table axis included; None where not known."""
    complete: bool
    """Whether that was worked out; ``measure_again`` does it."""
    doubt: str = ""
    """What speaks against it being of the same part as where it was made."""


class FeatureShown(Model):
    """A feature of a reference, and how what was measured of it lies to it, mm."""

    number: Count
    nominal: str
    """In words."""
    points: Count
    mean: float
    rms: float


class SizeCheck(Model):
    """A size of features of a reference, or the profile of one; mm, or degrees."""

    features: list[Count]
    quantity: str
    nominal: float
    measured: float
    uncertainty: float | None
    """k = 2."""
    unit: str
    tolerance: str
    """As the table has it; empty where it says nothing."""
    limits: tuple[float, float] | None
    """Of the deviation from nominal."""
    verdict: Literal["pass", "fail", "undecided", ""]
    """By ISO 14253-1."""


class Figures(Model):
    """What the surface is like now."""

    vertices: Count
    faces: Count
    bounds: Box | None
    closed: bool
    volume: float | None
    """mm³; None where the surface is open."""


Option = bool | int | float | str | None


class SettingsSet(Model):
    """A named set of settings in a scan file."""

    name: str
    options: dict[str, Option]


class ScanSettings(Model):
    """What the surface of a scan is made with."""

    options: dict[str, Option]
    """Every option of a reconstruction, by name; null leaves it to turnscan."""
    volume: tuple[float, float | None, float | None]
    """Radius, lowest and largest height of the rig's own working volume, mm; None for no limit."""
    sets: list[SettingsSet]
    """The named sets in the file; to take one up is an edit with its options."""


class CalibrationView(Model):
    """A picture of a calibration."""

    view: Count
    stage: Literal["camera", "laser", "table"]
    laser: str
    """Lit in it; empty for none."""
    name: str
    failure: str
    """Why it cannot be used; empty where it can."""
    corners: Count
    rms_px: float | None
    """How far its corners are off in the last adjustment; None before one."""


Verdict = Literal["good", "usable", "refused"]
"""No warnings; warnings, but worth a scan; not worth one, and not kept."""


class CalibrationVerdict(Model):
    """What a calibration came to."""

    verdict: Verdict
    text: str
    hint: str
    rig: str
    """The rig file that was written; empty for none."""
    report: Opaque | None
    """The file of its report: at ``/api/files/{file}/page``."""
    findings: list[Remark]


class VerificationTrend(Model):
    """One test value in all runs with an artefact and a rig, mm."""

    name: str
    times: list[str]
    """ISO time, UTC."""
    values: list[float]
    noise: list[float]
    """Expanded uncertainty (k = 2) of each by itself."""
    limit: float | None
    alarm: bool
    """Whether the newest value drifts beyond the limit of its control chart."""


class VerificationRuns(Model):
    """All runs with one artefact and one rig."""

    artefact: str
    rig: str
    """Digest of the rig; empty where unknown."""
    trends: list[VerificationTrend]


class FoundDevice(Model):
    """Something that can be connected."""

    address: str
    text: str
    role: Literal["camera", "board"]


class GridEntry(Model):
    """One grid: a laser, and a run of steps of it (a whole turn of the table, where there are
    several). The profile of a vertex is in the grid of its laser that holds its step."""

    grid: Count
    laser: str
    first_step: Count
    last_step: Count


# Headers of binary GETs


class MeshHeader(Model):
    """Of ``mesh``."""

    scan: Opaque
    revision: Count
    epoch: Count
    lasers: list[str]
    """What the numbers in the array laser stand for."""
    unit: Literal["mm"] = "mm"


class FileMeshHeader(Model):
    """Of ``/api/files/{file}/mesh``; its own colours are the array colour u8 (v, 3)."""

    lasers: list[str]
    """What the numbers in the array laser stand for."""
    unit: Literal["mm"] = "mm"


class GridHeader(Model):
    """Of ``grid``."""

    scan: Opaque
    revision: Count
    grid: Count
    laser: str
    closed: bool
    orientation: Literal["vertical", "horizontal"]
    causes: list[str]
    """Words for people; 0 is there: nothing is missing."""


class ProfileHeader(Model):
    """Of ``profile``."""

    scan: Opaque
    revision: Count
    grid: Count
    laser: str
    step: Count
    angle_deg: float
    orientation: Literal["vertical", "horizontal"]
    width: Count
    height: Count
    threshold: float
    strategy: str
    edited: bool


# Server → browser


class Hello(Model):
    """The first message: where things stand."""

    kind: Literal["hello"] = "hello"
    protocol: int
    version: str
    client: Opaque
    operator: Opaque | None
    scans: list[ScanEntry]
    binned: list[BinEntry]
    lasers_allowed: bool
    """False for a browser on another computer, unless the server is configured otherwise."""
    can_show_folder: bool
    """Whether ``show_folder`` opens it where this person sees it: on the server's computer."""


class Done(Model):
    """The request is done."""

    kind: Literal["done"] = "done"
    id: Count
    findings: list[Remark] = []
    """What there is to say of it."""


class Refused(Model):
    """The request is not done, and nothing has changed."""

    kind: Literal["refused"] = "refused"
    id: Count | None
    code: str
    """``stale``, ``cancelled``, ``not-operator``, ``no-lasers``, ``busy``, ``bad-request`` or the
    error's name."""
    text: str
    hint: str
    options: list[RemedyOption] = []
    """What the error is about, first, and what the hint names."""


class StartedJob(Model):
    """The request goes on as a job."""

    kind: Literal["started"] = "started"
    id: Count
    job: Opaque


class JobState(Model):
    """A job, each time it gets on; the last message has ``state`` done, failed or cancelled."""

    kind: Literal["job"] = "job"
    job: Opaque
    what: Literal["open", "edit", "export", "doctor", "calibrate", "scan", "verb", "demo"]
    scan: Opaque | None
    title: str
    state: Literal["running", "done", "failed", "cancelled"]
    done: Count
    total: Count | None
    seconds_left: float | None
    text: str
    hint: str
    options: list[RemedyOption] = []
    """Where it failed: what the error is about, first, and what the hint names."""
    download: Opaque | None
    files: list[ResultFile]
    tables: list[ResultTable] = []
    findings: list[Remark]


class Verbs(Model):
    """What the server does with files."""

    kind: Literal["verbs"] = "verbs"
    id: Count
    verbs: list[VerbEntry]


class Files(Model):
    """The files that verbs take; to everybody where they have changed."""

    kind: Literal["files"] = "files"
    id: Count | None
    files: list[FileEntry]


class SeriesSeen(Model):
    """What was recognised in the pictures of one laser."""

    laser: str
    pictures: list[str]
    """Their names, in the order of their steps."""
    steps: list[Count]
    """Of the pictures."""
    missing: list[Count]
    """Steps without a picture."""
    background: str
    """Where the pictures without laser come from, in words."""
    noise: float
    threshold: float
    """Grey levels."""
    line_share: float
    """Share of the lines of the samples with a stripe that is a line."""


class ImportPreviewed(Model):
    """What an import would make of pictures: arrays jpeg u8 (bytes) of one of them, and stripe f32
    (lines), NaN where there is none."""

    kind: Literal["import_preview"] = "import_preview"
    id: Count
    series: list[SeriesSeen]
    weights: list[float] | None
    """Of red, green and blue in the laser's light; None for grey pictures."""
    findings: list[Remark]
    laser: str
    picture: Count
    step: Count
    width: Count
    height: Count
    orientation: Literal["vertical", "horizontal"]


class Control(Model):
    """Who is the operator now."""

    kind: Literal["control"] = "control"
    operator: Opaque | None
    clients: Count


class Beat(Model):
    """The server is alive: sent several times a second, so that its silence is a message, too."""

    kind: Literal["beat"] = "beat"


class Stopped(Model):
    """Somebody pressed STOP."""

    kind: Literal["stopped"] = "stopped"
    client: Opaque | None
    """Who; None where it was asked for by HTTP."""
    confirmed: bool
    """Whether all lasers are known to be dark, and the table to stand still."""


class Scans(Model):
    """The list of scan files has changed."""

    kind: Literal["scans"] = "scans"
    scans: list[ScanEntry]
    binned: list[BinEntry]


class Opened(Model):
    """A document is open: to who asked, and to everybody when it is first opened."""

    kind: Literal["opened"] = "opened"
    id: Count | None
    scan: Opaque
    name: str
    revision: Count
    epoch: Count
    steps: Count
    """Of the plan."""
    textured: bool
    """There are texture images, which the surface has its colours from."""
    grids: list[GridEntry]
    figures: Figures
    history: list[HistoryEntry]
    cursor: Count
    branches: list[BranchEntry]
    scanned_picture: str
    """As that of an edit, before all of them."""
    findings: list[Remark]
    measures: list[Measure]
    settings: ScanSettings
    fields: dict[str, dict[str, Any]]
    """What each of the settings may be, by name, in the words of JSON Schema."""


class Closed(Model):
    """A document was closed, since its file is renamed or in the bin."""

    kind: Literal["closed"] = "closed"
    scan: Opaque


class Append(Model):
    """New vertices and faces at the end: positions, faces, measured, sigma, laser, step, line."""

    kind: Literal["append"] = "append"


class Truncate(Model):
    """Only so many vertices and faces are left: what was appended last is removed."""

    kind: Literal["truncate"] = "truncate"
    vertices: Count
    faces: Count


class Alive(Model):
    """Faces (array faces u32) that die or come back."""

    kind: Literal["alive"] = "alive"
    value: bool


class Verts(Model):
    """Vertices that moved: arrays ids u32 (k), positions f32 (k, 3)."""

    kind: Literal["verts"] = "verts"


class Replace(Model):
    """Another mesh altogether, of a new epoch: get it."""

    kind: Literal["replace"] = "replace"


Part = Annotated[Append | Truncate | Alive | Verts | Replace, Field(discriminator="kind")]


class Patch(Model):
    """What one edit did to the surface: parts, to be done in this order, all or none.

    The arrays of part k are named ``k.faces`` and so on.
    """

    kind: Literal["patch"] = "patch"
    scan: Opaque
    revision: Count
    epoch: Count
    text: str
    parts: list[Part]
    figures: Figures


class History(Model):
    """The list of edits; those from ``cursor`` on are undone."""

    kind: Literal["history"] = "history"
    scan: Opaque
    history: list[HistoryEntry]
    cursor: Count
    branches: list[BranchEntry]
    scanned_picture: str
    """As that of an edit, before all of them."""


class SettingsChanged(Model):
    """Other settings hold, or are kept by name; the surface and the grids follow by themselves."""

    kind: Literal["settings"] = "settings"
    scan: Opaque
    settings: ScanSettings
    grids: list[GridEntry]
    findings: list[Remark]


class SettingsTried(Model):
    """What settings would make of a part of the scan. Arrays ``old.K`` and ``new.K`` f32 (n, 3) of
    profile K, NaN where it is torn; positions f32 (v, 3) and faces u32 (f, 3) of the patches as
    ``old.positions`` and so on; ``new.distance`` f32 (v,) from the old one, NaN where it has
    nothing."""

    kind: Literal["settings_tried"] = "settings_tried"
    id: Count
    scan: Opaque
    laser: str
    steps: list[Count]
    """Of the profiles, the one at hand first."""
    findings: list[Remark]


class SettingsCompared(Model):
    """Two settings side by side. Arrays positions f32 (v, 3), faces u32 (f, 3) and distance f32
    (v,) of both, as ``first.positions`` and so on: mm from the other surface, NaN where that has
    nothing."""

    kind: Literal["settings_compared"] = "settings_compared"
    id: Count
    scan: Opaque
    mean: float
    """mm, of the second surface from the first."""
    rms: float
    p95: float
    worst: float
    areas: tuple[float, float]
    """mm², of both."""
    won: float
    """mm² of the second where the first has nothing."""
    lost: float
    """mm² of the first where the second has nothing."""


class GridChanged(Model):
    """Rows of a grid are others now: get them."""

    kind: Literal["grid"] = "grid"
    scan: Opaque
    grid: Count
    steps: list[Count]


class PreviewShown(Model):
    """What an edit would do: arrays positions f32 (v, 3), faces u32 (f, 3) that it would add and
    dead u32 that it would take away. Nothing is stored."""

    kind: Literal["preview"] = "preview"
    id: Count
    figures: Figures


class Holes(Model):
    """Some of the holes, the largest first."""

    kind: Literal["holes"] = "holes"
    id: Count
    scan: Opaque
    revision: Count
    many: Count
    """How many there are in all."""
    holes: list[HoleEntry]


class Defects(Model):
    """What is wrong with a scan, and where."""

    kind: Literal["defects"] = "defects"
    id: Count
    scan: Opaque
    revision: Count
    defects: list[Defect]


class Measures(Model):
    """The measurements kept with a scan; ``id`` where one was asked for."""

    kind: Literal["measures"] = "measures"
    id: Count | None
    scan: Opaque
    measures: list[Measure]


class DeviationShown(Model):
    """How far the surface lies from a reference. Array ``distance`` (v,) mm: f32, of each vertex,
    positive outside, NaN where it was not measured or the reference says nothing."""

    kind: Literal["deviation"] = "deviation"
    id: Count
    scan: Opaque
    revision: Count
    reference: str
    vertices: Count
    mean: float
    rms: float
    p95: float
    worst: float
    alignment: str
    """How the surface was brought onto the reference, in words."""
    findings: list[Remark]
    features: list[FeatureShown]
    checks: list[SizeCheck]
    verdict: Literal["pass", "fail", "undecided", ""]
    """Whether all tolerances are kept; empty without any."""


class ColoursShown(Model):
    """Colours of the surface from its texture images. Array ``colour`` (v, 3): u8, of each vertex,
    grey where no image shows it."""

    kind: Literal["colours"] = "colours"
    id: Count
    scan: Opaque
    revision: Count


class ShapeEntry(Model):
    """A shape of the surface."""

    text: str
    """With its sizes and their uncertainties."""
    place: Vector
    """Its middle, mm."""
    size: float
    """mm: how far it reaches."""


class ShapesShown(Model):
    """The shapes of a surface. Array ``shape`` i32 (v,): of each vertex the index of its shape, −1
    for freeform and for what was not measured."""

    kind: Literal["shapes"] = "shapes"
    id: Count
    scan: Opaque
    revision: Count
    shapes: list[ShapeEntry]
    coverage: float
    """Share of the measured area that lies on shapes."""
    relations: list[str]
    dimensions: ResultTable
    findings: list[Remark]


class Found(Model):
    """What is connected to the computer."""

    kind: Literal["found"] = "found"
    id: Count
    devices: list[FoundDevice]
    notes: list[Remark]


class Devices(Model):
    """The devices in use, each time something changes, and each second while a laser may be lit."""

    kind: Literal["devices"] = "devices"
    addresses: list[str]
    """Camera, turntable, lasers; empty where nothing is connected."""
    camera: DeviceState
    table: DeviceState
    angle_deg: float | None
    lasers: list[LaserState]
    looking: bool
    rig: bool
    """Whether a rig (calibration) is known for them."""
    rig_name: str
    """Of the file it is from; empty for that of a simulated rig."""
    rigs: list[str]
    """Rig files in the folder, for ``use_rig``."""


class Calibration(Model):
    """A calibration in the making, each time a picture has been looked at. Array ``marked`` f32
    (n, 3): every corner of the board that was seen, u and v px, and the number of its view."""

    kind: Literal["calibration"] = "calibration"
    board: str
    views: list[CalibrationView]
    coverage: float
    """Share of the cells of the picture in which a corner of the board was seen."""
    columns: Count
    rows: Count
    cells: list[int]
    """Corners in each cell, row by row from the top left."""
    width: Count
    height: Count
    """Of the pictures."""
    missing: list[str]
    """What is still wanted, in words."""
    undetermined: list[str]
    """What no pictures have determined yet."""
    advice_stage: str
    """Which pictures would help most: camera, table, or the name of a laser; empty for none."""
    advice: str
    """The same in words; empty before it is known."""
    verdict: CalibrationVerdict | None


class Verifications(Model):
    """The history of verifications of the folder, the newest last."""

    kind: Literal["verifications"] = "verifications"
    id: Count
    histories: list[VerificationRuns]


class Seen(Model):
    """A live picture: arrays jpeg u8 (bytes); stripe, stripe_width and stripe_signal f32 (lines),
    px and grey levels, NaN where there is none; corners f32 (n, 2) of the calibration's board;
    histogram u32 of grey levels, from black to the largest possible value.

    Send ``ack`` with its number; with two unanswered the server sends no more.
    """

    kind: Literal["frame"] = "frame"
    number: Count
    width: Count
    height: Count
    orientation: Literal["vertical", "horizontal"]
    lit: list[str]
    step: Count | None
    view: Count | None
    """Of the calibration, where it was taken for it."""
    failure: str
    """Why the calibration's board was not found, where it was looked for."""
    saturated: float
    """Share of the stripe's lines that are clipped."""
    sharpness: float
    """Focus measure: largest in focus, for one scene at any exposure."""
    clipped: float
    """Share of the pixels at the largest possible value."""


class Points(Model):
    """Points of a scan that is being taken, to be added: array points f32 (m, 3)."""

    kind: Literal["points"] = "points"
    scan: Opaque
    laser: str
    step: Count


class Scanning(Model):
    """A scan that is being taken."""

    kind: Literal["scanning"] = "scanning"
    scan: Opaque
    state: Literal["running", "paused", "complete", "aborted", "failed"]
    done: Count
    total: Count
    seconds_left: float | None
    missing: Count
    text: str
