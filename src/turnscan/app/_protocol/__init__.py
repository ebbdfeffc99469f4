"""The protocol between server and browser; `frontend/src/protocol.ts` is generated from it.

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
  Each opening of a scan begins with ``revision`` 0 and an epoch that no opening before it had.
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
- ``quality``: header `MeshHeader`; sigma f32 (v) mm, pooled over the region about each vertex, NaN
  where there is none.
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
(``?board=&paper=``) a board to print, ``/api/dial.pdf`` (``?markers=&paper=``) a dial for the
platter. Requests that change something need the header ``X-Turnscan: 1``.
"""

from turnscan.app._protocol._base import (
    VERSION,
    Box,
    Count,
    Model,
    Name,
    Opaque,
    Remark,
    RemedyOption,
    Vector,
)
from turnscan.app._protocol._calibration import (
    Calibration,
    CalibrationVerdict,
    CalibrationView,
    Verdict,
    VerificationRuns,
    Verifications,
    VerificationTrend,
)
from turnscan.app._protocol._connection import (
    Beat,
    Control,
    Done,
    Hello,
    JobState,
    Refused,
    StartedJob,
    Stopped,
)
from turnscan.app._protocol._document import (
    Alive,
    Append,
    BranchEntry,
    Closed,
    ColoursShown,
    Figures,
    FirstSurface,
    GridChanged,
    History,
    HistoryEntry,
    Opened,
    Part,
    Patch,
    PreviewShown,
    Replace,
    Truncate,
    Verts,
)
from turnscan.app._protocol._folder import BinEntry, FindingCounts, ScanEntry, Scans
from turnscan.app._protocol._headers import (
    FileMeshHeader,
    GridEntry,
    GridHeader,
    MeshHeader,
    ProfileHeader,
)
from turnscan.app._protocol._inspection import (
    Defect,
    Defects,
    DeviationShown,
    FeatureShown,
    HoleEntry,
    Holes,
    Measure,
    Measures,
    ShapeEntry,
    ShapesShown,
    SizeCheck,
)
from turnscan.app._protocol._rig import (
    Devices,
    DeviceState,
    Found,
    FoundDevice,
    LaserState,
    Points,
    Scanning,
    Seen,
)
from turnscan.app._protocol._settings import (
    Option,
    ScanSettings,
    SettingsChanged,
    SettingsCompared,
    SettingsSet,
    SettingsTried,
)
from turnscan.app._protocol._verbs import (
    FileEntry,
    Files,
    ImportPreviewed,
    ResultFile,
    ResultTable,
    SeriesSeen,
    VerbEntry,
    Verbs,
)

__all__ = [
    "VERSION",
    "Alive",
    "Append",
    "Beat",
    "BinEntry",
    "Box",
    "BranchEntry",
    "Calibration",
    "CalibrationVerdict",
    "CalibrationView",
    "Closed",
    "ColoursShown",
    "Control",
    "Count",
    "Defect",
    "Defects",
    "DeviationShown",
    "DeviceState",
    "Devices",
    "Done",
    "FeatureShown",
    "Figures",
    "FileEntry",
    "FileMeshHeader",
    "Files",
    "FindingCounts",
    "FirstSurface",
    "Found",
    "FoundDevice",
    "GridChanged",
    "GridEntry",
    "GridHeader",
    "Hello",
    "History",
    "HistoryEntry",
    "HoleEntry",
    "Holes",
    "ImportPreviewed",
    "JobState",
    "LaserState",
    "Measure",
    "Measures",
    "MeshHeader",
    "Model",
    "Name",
    "Opaque",
    "Opened",
    "Option",
    "Part",
    "Patch",
    "Points",
    "PreviewShown",
    "ProfileHeader",
    "Refused",
    "Remark",
    "RemedyOption",
    "Replace",
    "ResultFile",
    "ResultTable",
    "ScanEntry",
    "ScanSettings",
    "Scanning",
    "Scans",
    "Seen",
    "SeriesSeen",
    "SettingsChanged",
    "SettingsCompared",
    "SettingsSet",
    "SettingsTried",
    "ShapeEntry",
    "ShapesShown",
    "SizeCheck",
    "StartedJob",
    "Stopped",
    "Truncate",
    "Vector",
    "VerbEntry",
    "Verbs",
    "Verdict",
    "VerificationRuns",
    "VerificationTrend",
    "Verifications",
    "Verts",
]
