"""What the browser asks for: requests on the WebSocket, and bodies of POSTs (see `_protocol`)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from turnscan.app._protocol import Count, Model, Name, Opaque, Vector
from turnscan.workflows import LONGEST_PAUSE, MOST_PICTURES, Orientation

Stage = Literal["camera", "laser", "table"]
Seconds = Annotated[float, Field(gt=0, le=60)]
Angle = Annotated[float, Field(ge=-36000, le=36000)]
"""Degrees."""
Ruler = Annotated[float, Field(gt=0, le=1000)]
Limit = Annotated[float, Field(ge=-1e6, le=1e6)]


class Request(Model):
    """What all requests have."""

    id: Count


class Stop(Request):
    """Lasers dark and table stopped, at once; a scan being taken ends. Anybody may."""

    kind: Literal["stop"] = "stop"


class TakeControl(Request):
    """Become the operator."""

    kind: Literal["take_control"] = "take_control"


class ReleaseControl(Request):
    """Be the operator no more."""

    kind: Literal["release_control"] = "release_control"


class Ack(Model):
    """A live picture has been shown; not answered."""

    kind: Literal["ack"] = "ack"
    number: Count


class Cancel(Request):
    """End a job."""

    kind: Literal["cancel"] = "cancel"
    job: Opaque


class Open(Request):
    """Open a scan: answered by ``opened``, or by ``started`` and, later, ``opened``."""

    kind: Literal["open"] = "open"
    scan: Opaque


class Rename(Request):
    """Give a scan file another name; a document of it is closed."""

    kind: Literal["rename"] = "rename"
    scan: Opaque
    name: Name


class Duplicate(Request):
    """Copy a scan file with its edits, under a new name."""

    kind: Literal["duplicate"] = "duplicate"
    scan: Opaque
    name: Name


class ToBin(Request):
    """Put a scan file into the bin of its folder; a document of it is closed."""

    kind: Literal["to_bin"] = "to_bin"
    scan: Opaque


class Restore(Request):
    """Take a scan file out of the bin, under its name or, where that is taken, a numbered one."""

    kind: Literal["restore"] = "restore"
    binned: Opaque


class EmptyBin(Request):
    """Delete for good what is in the bin."""

    kind: Literal["empty_bin"] = "empty_bin"


class ShowFolder(Request):
    """Open the folder of the scans in the file manager of the server's computer."""

    kind: Literal["show_folder"] = "show_folder"


class TryDemo(Request):
    """Scan a part with a simulated rig, as a job whose result is the scan."""

    kind: Literal["try_demo"] = "try_demo"


class ListVerbs(Request):
    """Answered by ``verbs``."""

    kind: Literal["list_verbs"] = "list_verbs"


class ListFiles(Request):
    """Answered by ``files``."""

    kind: Literal["list_files"] = "list_files"


class RunVerb(Request):
    """Run a verb as a job: its findings, text and files are what it came to.

    ``values`` are those of its schema: options as they are, inputs by the opaque names of files
    and scans, outputs by the suffixes that are wanted. What is left out has its default.
    """

    kind: Literal["run_verb"] = "run_verb"
    verb: Name
    name: Name
    """Of the files that it writes."""
    values: dict[str, Any]


class PreviewImport(Request):
    """What an import would make of pictures: answered by ``import_preview``; nothing is written.

    ``values`` are those of the verb ``import``; of its options those about pictures count.
    """

    kind: Literal["preview_import"] = "preview_import"
    values: dict[str, Any]
    laser: str = ""
    """Whose picture is shown; empty for the first one."""
    picture: Count | None = None
    """Its place in the series; None takes the middle one."""


class EditRequest(Request):
    """Do an edit: ``done`` after its patch. With ``preview``, answered by ``preview``.

    ``edit`` is one of the values of `turnscan.edit`, its ``faces`` or ``vertices`` left out where
    they are arrays of the envelope.
    """

    kind: Literal["edit"] = "edit"
    scan: Opaque
    base_revision: Count
    edit: dict[str, Any]
    preview: bool = False


class Undo(Request):
    """One edit back."""

    kind: Literal["undo"] = "undo"
    scan: Opaque


class Redo(Request):
    """One edit on again."""

    kind: Literal["redo"] = "redo"
    scan: Opaque


class GoTo(Request):
    """To the state after an edit, of the history or of a branch, which becomes the history."""

    kind: Literal["go_to"] = "go_to"
    scan: Opaque
    edit: Count
    """Its number; 0: as scanned."""


class NameEdit(Request):
    """Name an edit, of a branch too; an empty name takes it away."""

    kind: Literal["name_edit"] = "name_edit"
    scan: Opaque
    edit: Count
    name: Annotated[str, Field(max_length=80)]


class Switch(Request):
    """One edit of the list off or on again, all others as they are."""

    kind: Literal["switch"] = "switch"
    scan: Opaque
    edit: Count
    on: bool


class CopyEdits(Request):
    """Add edits of a scan to another one, in their order; a document of that is closed.

    ``done`` says which of them do not fit there.
    """

    kind: Literal["copy_edits"] = "copy_edits"
    scan: Opaque
    edits: Annotated[tuple[Count, ...], Field(min_length=1)]
    """Their numbers."""
    to: Opaque
    by_shape: bool = False
    """Whether the part stands elsewhere there: measurements are brought along by its shape."""


class TrySettings(Request):
    """What settings would make of a few profiles and a patch: answered by ``settings_tried``.

    An earlier trial of the same browser that is still under way is refused as ``cancelled``.
    """

    kind: Literal["try_settings"] = "try_settings"
    scan: Opaque
    options: dict[str, Any]
    grid: Count
    step: Count | None = None
    """None takes the middle one."""


class CompareSettings(Request):
    """Two settings side by side, with all edits: answered by ``settings_compared``."""

    kind: Literal["compare_settings"] = "compare_settings"
    scan: Opaque
    first: dict[str, Any]
    """Options by name; those left out are at their default."""
    second: dict[str, Any]
    gap: Annotated[float, Field(gt=0, le=1000)] = 0.2
    """mm: what is further than this from the other surface has no counterpart there."""


class ListHoles(Request):
    """Answered by ``holes``: from the ``first`` on, the largest being number 0."""

    kind: Literal["list_holes"] = "list_holes"
    scan: Opaque
    first: Annotated[int, Field(ge=0, le=2**31)] = 0


class ListDefects(Request):
    """Answered by ``defects``."""

    kind: Literal["list_defects"] = "list_defects"
    scan: Opaque


class TakeMeasure(Request):
    """Measure, and keep it with the scan: answered by ``measures``.

    ``distance``: two places; ``angle``: three places, the second is the corner; ``to_plane``: a
    place, and a region (array faces); ``diameter``: a region, or one place whose height is that of
    the section; ``area`` and ``volume``: of the whole surface, ``area`` of a region too.
    """

    kind: Literal["measure"] = "measure"
    scan: Opaque
    what: Literal["distance", "to_plane", "diameter", "angle", "area", "volume"]
    places: Annotated[tuple[Vector, ...], Field(max_length=3)] = ()


class ForgetMeasure(Request):
    """Answered by ``measures``."""

    kind: Literal["forget_measure"] = "forget_measure"
    scan: Opaque
    measure: Opaque


class SpecifyMeasure(Request):
    """Name a measurement, and say what it is to be: answered by ``measures``.

    Limits are deviations from the nominal value, in its unit; without them it is only named.
    """

    kind: Literal["specify"] = "specify"
    scan: Opaque
    measure: Opaque
    name: Annotated[str, Field(max_length=80)] = ""
    nominal: Limit | None = None
    lower: Limit | None = None
    upper: Limit | None = None


class MeasureAgain(Request):
    """Take measurements again of which the surface was changed since: answered by ``measures``."""

    kind: Literal["measure_again"] = "measure_again"
    scan: Opaque


class ShowDeviation(Request):
    """Compare with a mesh, a CAD part or a scan: answered by ``deviation``."""

    kind: Literal["show_deviation"] = "show_deviation"
    scan: Opaque
    reference: Opaque
    """A file of the list, or a scan."""
    unit: Literal["mm", "cm", "m", "inch"] = "mm"
    """Of the reference."""
    align: Literal["none", "shape", "datums"] = "none"
    datums: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(max_length=6)] = ()
    """Numbers of features of the reference, in the order of precedence."""
    features: bool = False
    """Whether its features and their sizes are listed."""
    tolerance_table: Opaque | None = None
    """A file of the list."""


class ShowColours(Request):
    """Colours of the surface from its texture images: answered by ``colours``."""

    kind: Literal["show_colours"] = "show_colours"
    scan: Opaque


class FindShapes(Request):
    """Find the shapes that the surface is made of: answered by ``shapes``."""

    kind: Literal["find_shapes"] = "find_shapes"
    scan: Opaque


class SaveReport(Request):
    """Write the report of all sizes and kept measurements into the folder: a job."""

    kind: Literal["save_report"] = "save_report"
    scan: Opaque
    name: Name
    suffix: Literal[".pdf", ".html", ".csv", ".json"]


class FindDevices(Request):
    """Answered by ``found``; with ``probe``, serial ports are opened and asked."""

    kind: Literal["find_devices"] = "find_devices"
    probe: bool = False


class Connect(Request):
    """Open devices by address; a simulated rig is one address for all three."""

    kind: Literal["connect"] = "connect"
    camera: Name
    turntable: Name
    lasers: Name


class Disconnect(Request):
    """Lasers dark, and let the devices go."""

    kind: Literal["disconnect"] = "disconnect"


class Look(Request):
    """Live pictures with these lasers lit, until it is sent with ``on`` false."""

    kind: Literal["look"] = "look"
    on: bool
    lit: tuple[Name, ...] = ()
    seconds: Seconds | None = None
    """Exposure; None takes what suits the devices."""
    gain: Annotated[float, Field(gt=0, le=1000)] = 1.0
    orientation: Orientation = "vertical"
    board: bool = False
    """Look for the board of the calibration in them."""


class Turn(Request):
    """Turn the table to an angle."""

    kind: Literal["turn"] = "turn"
    angle_deg: Angle


class Doctor(Request):
    """Look at the devices: a job with findings."""

    kind: Literal["doctor"] = "doctor"
    still: bool = False
    seconds: Seconds | None = None


class UseRig(Request):
    """Take the rig of a file in the folder for the scans from now on."""

    kind: Literal["use_rig"] = "use_rig"
    name: Name


class BeginCalibration(Request):
    """Start a new calibration; ``calibration`` tells from now on how far it is.

    ``board`` as ``chessboard:8x6:40`` (inner corners, mm) or ``charuco:7x5:25:19:DICT_4X4_50``;
    ``table`` says what is fixed to the table: ``markers:DICT_4X4_50:30``, or a board.
    """

    kind: Literal["calibrate_begin"] = "calibrate_begin"
    board: Name
    table: Name
    lowest_mm: Annotated[float, Field(ge=-1000, le=1000)] = 0.0
    """Height of the lowest corner of the board on the table."""
    orientation: Orientation = "vertical"
    rulers_mm: tuple[Ruler, Ruler] = (100.0, 100.0)
    """What the two printed rulers of 100 mm measure."""


class Capture(Request):
    """Take pictures for the calibration, of its board or of what is fixed to the table: a job.

    With a range the table turns, a picture at each stop; without, it rests, and ``every`` s before
    each picture a hand has time to move the board. ``laser`` names the laser that is lit for a
    second picture; the stage laser takes one with each there is.
    """

    kind: Literal["capture"] = "capture"
    stage: Stage
    count: Annotated[int, Field(ge=1, le=MOST_PICTURES)] = 1
    every: Annotated[float, Field(ge=0, le=LONGEST_PAUSE)] = 0.0
    range_deg: tuple[Angle, Angle] | None = None
    laser: Name | None = None
    seconds: Seconds | None = None


class ForgetView(Request):
    """Take a picture of the calibration away."""

    kind: Literal["forget_view"] = "forget_view"
    view: Count


class FinishCalibration(Request):
    """Calibrate with the pictures there are: a job whose findings name every picture not used.

    The rig is kept in the folder under this name, and used from now on.
    """

    kind: Literal["calibrate_finish"] = "calibrate_finish"
    name: Name


class ListVerifications(Request):
    """Answered by ``verifications``."""

    kind: Literal["list_verifications"] = "list_verifications"


class ScanPlan(Model):
    """What a scan is to be; None leaves it to the server, which says what it chose."""

    name: Name
    steps: Annotated[int, Field(ge=1, le=100000)] | None = None
    from_deg: float = 0.0
    to_deg: float = 360.0
    lasers: tuple[Name, ...] | None = None
    seconds: Annotated[tuple[Seconds, ...], Field(max_length=8)] = ()
    gain: Annotated[float, Field(gt=0, le=1000)] = 1.0
    keep: Literal["sparse", "full"] = "sparse"
    threshold: Annotated[float, Field(ge=0, le=65535)] | None = None
    orientation: Orientation = "vertical"
    """Orientation of the stripe in the picture."""
    texture: Seconds | None = None
    """Exposure of a whole picture without laser, taken too; None for none."""
    texture_every: Annotated[int, Field(ge=1, le=100000)] = 1
    """Steps."""
    lamps: Annotated[tuple[Name, ...], Field(max_length=64)] = ()
    """Outputs of the laser board that are lamps: never lit as lasers, but for those pictures."""


class StartScan(Request):
    """Take a scan: a job; ``scanning``, ``frame`` and ``points`` tell how it goes."""

    kind: Literal["scan"] = "scan"
    plan: ScanPlan


class Resume(Request):
    """Take what an interrupted scan is missing, with the devices that are connected: a job."""

    kind: Literal["resume"] = "resume"
    scan: Opaque
    retake: bool = False
    """Also take frames again that are damaged or recorded as missing."""
    at_deg: Angle | None = None
    """Current table angle in the scan's frame, set by the operator, degrees."""


class Pause(Request):
    """Wait after the picture that is being taken, lasers dark."""

    kind: Literal["pause"] = "pause"


class GoOn(Request):
    """End the pause."""

    kind: Literal["go_on"] = "go_on"


class Abort(Request):
    """End the scan; what was taken stays, and can be resumed."""

    kind: Literal["abort"] = "abort"


ClientMessage = Annotated[
    Stop
    | TakeControl
    | ReleaseControl
    | Ack
    | Cancel
    | Open
    | Rename
    | Duplicate
    | ToBin
    | Restore
    | EmptyBin
    | ShowFolder
    | TryDemo
    | ListVerbs
    | ListFiles
    | RunVerb
    | PreviewImport
    | EditRequest
    | Undo
    | Redo
    | GoTo
    | NameEdit
    | Switch
    | CopyEdits
    | TrySettings
    | CompareSettings
    | ListHoles
    | ListDefects
    | TakeMeasure
    | ForgetMeasure
    | SpecifyMeasure
    | MeasureAgain
    | ShowDeviation
    | ShowColours
    | FindShapes
    | SaveReport
    | FindDevices
    | Connect
    | Disconnect
    | Look
    | Turn
    | Doctor
    | UseRig
    | BeginCalibration
    | Capture
    | ForgetView
    | FinishCalibration
    | ListVerifications
    | StartScan
    | Resume
    | Pause
    | GoOn
    | Abort,
    Field(discriminator="kind"),
]


# Bodies of POSTs


class LoginRequest(Model):
    """POST ``/login``: the token from the link, for a cookie."""

    token: Annotated[str, Field(max_length=200)]


class Invitation(Model):
    """POST ``/api/invitations``: a link for one more browser, good once."""

    path: str


class ExportRequest(Model):
    """POST ``/api/scans/{scan}/exports``."""

    format: Literal["dxf", "stl", "ply", "obj", "3mf", "glb", "xyz"]
    dxf_forms: tuple[Literal["3dface", "polyface", "mesh", "profiles"], ...] = ("3dface",)
    dxf_version: Literal["R12", "R2010"] | None = None
    ascii: bool = False


class StartedExport(Model):
    """Its answer."""

    job: Opaque


class Added(Model):
    """The answer to POST ``/api/scans``."""

    scan: Opaque


class Received(Model):
    """The answer to POST ``/api/files``."""

    into: Opaque
    """The set of files, for the next one that belongs to it."""
    files: list[Opaque]
    """What is in the set now."""


class Uploaded(Model):
    """The answer to POST and GET ``/api/uploads``: how much of a file is here."""

    upload: Opaque
    received: int
    """Bytes; the next piece begins there."""


class Problem(Model):
    """The body of every HTTP error."""

    code: str
    text: str
    hint: str


REQUESTS: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)
BODIES = (
    LoginRequest, Invitation, ExportRequest, StartedExport, Added, Received, Uploaded, Problem,
)  # fmt: skip
"""Models that no message holds."""
