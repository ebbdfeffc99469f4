"""Exports: a document as a file of a CAD or print format, audited before it is handed out."""

from __future__ import annotations

from turnscan.app import _requests as q
from turnscan.app._downloads import Downloads
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._open_scan import OpenScan
from turnscan.errors import InputError
from turnscan.workflows import ExportOptions, audited


def export_job(jobs: Jobs, downloads: Downloads, scan: OpenScan, request: q.ExportRequest) -> Job:
    """Begin to write a document as a file. Raises InputError where it is impossible."""
    if not request.dxf_forms:
        raise InputError("dxf_forms: none chosen", hint="choose one or more")
    version = request.dxf_version or ("R2010" if "mesh" in request.dxf_forms else "R12")
    options = ExportOptions(
        dxf_forms=tuple(dict.fromkeys(request.dxf_forms)),
        dxf_version=version,
        ascii=request.ascii,
    )
    suffix, state = f".{request.format}", scan.now

    def work(job: Job) -> Result:
        result = scan.result(state, job.progress)
        mesh = result.mesh
        job.steps(2)
        job.at(0)
        if not len(mesh.faces):
            raise InputError("no surface to export", hint="undo, or open another scan")
        formats, lines = result.content(options)
        job.tick()
        data, found = audited(mesh, suffix, formats, lines, scan.path.stem + suffix)
        job.tick()
        name = downloads.add(data, scan.path.stem + suffix)
        size = f"{len(data) / 1e6:.2f} MB, read back the same"
        return Result(f"{scan.path.stem}{suffix}: {size}", name, [*result.findings, *found])

    return jobs.start("export", f"Exporting {scan.path.stem}{suffix}", work, scan.name)
