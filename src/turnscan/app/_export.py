"""Exports: a document as a file of a CAD or print format, audited before it is handed out."""

from __future__ import annotations

import io
import tempfile
import zipfile
from pathlib import Path

from turnscan.app import _requests as q
from turnscan.app._downloads import Downloads
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._open_scan import OpenScan
from turnscan.errors import InputError
from turnscan.workflows import FormatOptions, check_step


def export_job(jobs: Jobs, downloads: Downloads, scan: OpenScan, request: q.ExportRequest) -> Job:
    """Begin to write a document as a file, or as a zip where the format takes several.

    Raises InputError where it is impossible.
    """
    name, state = f"{scan.path.stem}.{request.format}", scan.now
    options = FormatOptions(
        dxf_forms=tuple(request.dxf_forms),
        dxf_version=request.dxf_version,
        ascii=request.ascii,
        obj_texture=request.obj_texture,
    ).export_options([Path(name)])
    check_step([Path(name)])

    def work(job: Job) -> Result:
        result = scan.result(state, job.progress.subrange(0.0, 0.5))
        if not len(result.mesh.faces):
            raise InputError("no surface to export", hint="undo, or open another scan")
        with tempfile.TemporaryDirectory(prefix="turnscan-") as folder:
            path = Path(folder) / name
            found = result.save(path, options=options, progress=job.progress.subrange(0.5, 1.0))
            parts = sorted(Path(folder).iterdir())
            given = path if parts == [path] else path.with_suffix(".zip")
            data = path.read_bytes() if given == path else _zipped(parts)
        job.check()
        size = f"{len(data) / 1e6:.2f} MB, read back the same"
        download = downloads.add(data, given.name)
        return Result(f"{given.name}: {size}", download, [*result.findings, *found])

    return jobs.start("export", f"Exporting {name}", work, scan.name)


def _zipped(files: list[Path]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            # Without the date: the same surface gives the same bytes.
            archive.writestr(zipfile.ZipInfo(file.name), file.read_bytes(), zipfile.ZIP_DEFLATED)
    return out.getvalue()
