"""What the workshop hands out where a format takes several files, and STEP by every way to save."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.mesh.open_meshes import ball as ball_of
from turnscan import workflows
from turnscan.app import _requests as q
from turnscan.app._downloads import Downloads
from turnscan.app._export import export_job
from turnscan.drawings import read_step
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.progress import no_progress


def _exported(mesh: Mesh, **asked: Any) -> tuple[str, bytes]:
    """The name of a download, and what it holds."""

    def save(path: Path, options: workflows.ExportOptions, **_: object) -> list[Finding]:
        return workflows.save({path: mesh}, options)

    result = SimpleNamespace(mesh=mesh, findings=(), save=save)
    scan = SimpleNamespace(
        path=Path("bust.turnscan"), now=None, name="x", result=lambda state, progress: result
    )
    job = SimpleNamespace(progress=no_progress, check=lambda: None)
    jobs = SimpleNamespace(start=lambda what, title, work, name: work(job))
    downloads = Downloads()
    done: Any = export_job(jobs, downloads, scan, q.ExportRequest(**asked))  # type: ignore[arg-type]
    path, name = downloads.find(done.download)
    data = path.read_bytes()
    downloads.close()
    return name, data


def test_an_obj_with_a_texture_is_a_zip_and_one_without_colours_is_not() -> None:
    ball = ball_of(12)
    painted = Mesh(
        ball.vertices, ball.faces, colour=np.full((len(ball.vertices), 3), 90, dtype=np.uint8)
    )
    name, data = _exported(painted, format="obj", obj_texture=True)
    assert name == "bust.zip"
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.namelist() == ["bust-texture.png", "bust.mtl", "bust.obj"]
        assert b"mtllib bust.mtl" in archive.read("bust.obj")
    assert (name, data) == _exported(painted, format="obj", obj_texture=True)
    assert _exported(painted, format="obj")[0] == "bust.obj"
    assert _exported(ball, format="obj", obj_texture=True)[0] == "bust.obj"


def test_step_is_a_format_like_any_other(tmp_path: Path) -> None:
    ball = ball_of(24)
    workflows.save({tmp_path / "ball.step": ball, tmp_path / "ball.stl": ball})
    assert (tmp_path / "ball.stl").is_file()
    (found,) = read_step((tmp_path / "ball.step").read_bytes(), 0.1).shapes
    assert found.kind == "sphere"
