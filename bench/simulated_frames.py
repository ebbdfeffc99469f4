"""Frames per second of the simulator: whole camera pictures, speckle and noise included.

``python -m bench simulated_frames [COMMIT]``. Each frame is at a new table angle. First stands the
least processor time of a frame, which says the same on a busy machine, at a commit (by default the
last before the simulator was made faster) and now, in turns, with a digest of the pictures: where
it is the same, the pictures are. Then frames per second of one process and of two.
"""

from __future__ import annotations

import hashlib
import io
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from turnscan.simulate import Renderer, SimulationSpec, bench, seconds_of

_SCENES = (
    ("cup", "paper", True, 24),
    ("cup", "paper", False, 48),
    ("head", "paper", True, 16),
    ("sphere", "modern", True, 6),
)
_SIZE = {"paper": "640 x 480", "modern": "2448 x 2048"}


PARTS = None
_BEFORE = "2cceee3"
_WANTED = 2.0
_TURNS = 3


def run(quick: bool = False, parts: Sequence[str] = (), into_pages: bool = False) -> None:
    """Print processor time a frame against that of another commit, then frames per second;
    ``quick`` the former for one scene alone, in one turn."""
    scenes, turns = (_SCENES[:1], 1) if quick else (_SCENES, _TURNS)
    lines = _against(parts[0] if parts else _BEFORE, scenes, turns)
    if into_pages and len(lines) == 2 + len(_SCENES) and not parts:
        from bench._page import DOCS, write

        write(DOCS / "explain" / "simulator.md", "frames", lines)
    if not quick:
        _rates()


def _against(commit: str, scenes: Sequence[tuple[str, str, bool, int]], turns: int) -> list[str]:
    """A table, printed row by row as it is measured; empty where there is no such commit."""
    root = Path(__file__).parent.parent
    said = subprocess.run(["git", "archive", commit, "src"], cwd=root, capture_output=True)
    if said.returncode:
        print(f"no commit {commit} to compare with: {said.stderr.decode().strip()}")
        return []
    lines = [f"| | ms a picture at {commit} | now | times as fast | wanted | pictures |"]
    lines.append("|---|---|---|---|---|---|")
    print("\n".join(lines))
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(said.stdout)) as archive:
            archive.extractall(folder, filter="data")
        for scene in scenes:
            before, now = [], []
            for _ in range(turns):
                before.append(_measured(Path(folder) / "src", scene))
                now.append(_measured(root / "src", scene))
            (old, digest), (new, same) = min(before), min(now)
            lines.append(
                f"| {_label(*scene[:3])} | {1e3 * old:.0f} | {1e3 * new:.0f} | {old / new:.2f} | "
                f"{_WANTED:g} | {'the same' if digest == same else 'others'} |"
            )
            print(lines[-1], flush=True)
    return lines


def _measured(source: Path, scene: tuple[str, str, bool, int]) -> tuple[float, str]:
    """s of processor time of the quickest frame with these sources, and the pictures' digest."""
    done = subprocess.run(
        [sys.executable, __file__, json.dumps(scene)],
        env={**os.environ, "PYTHONPATH": str(source)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    least, digest = json.loads(done.stdout.splitlines()[-1])
    return float(least), str(digest)


def _label(scene: str, rig: str, lit: bool) -> str:
    return f"{scene}{'' if lit else ' (dark)'}, {rig}, {_SIZE[rig]}"


def _rates() -> None:
    print(f"{'scene, rig':<34}{'one process':>12}{'two':>9}{'memory':>10}")
    context = multiprocessing.get_context("spawn")
    for scene, rig, lit, frames in _SCENES:
        rates = []
        for processes in (1, 2):
            barrier = context.Barrier(processes)
            queue = context.Queue()
            workers = [
                context.Process(target=_work, args=(scene, rig, lit, k, frames, barrier, queue))
                for k in range(processes)
            ]
            for w in workers:
                w.start()
            done = [queue.get() for _ in workers]
            for w in workers:
                w.join()
            rates.append(processes * frames / max(seconds for seconds, _ in done))
        size = max(memory for _, memory in done)
        label = _label(scene, rig, lit)
        print(f"{label:<34}{rates[0]:>8.1f} /s{rates[1]:>7.1f}/s{size:>7.0f} MB")


def _work(
    scene: str, rig: str, lit: bool, first: int, frames: int, barrier: object, queue: object
) -> None:
    picture = _camera(scene, rig, lit)
    barrier.wait()  # type: ignore[attr-defined]
    start = time.perf_counter()
    for k in range(frames):
        picture(2 * k + first)
    spent = time.perf_counter() - start
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    queue.put((spent, memory))  # type: ignore[attr-defined]


def _camera(scene: str, rig: str, lit: bool) -> Callable[[int], bytes]:
    """Takes the picture of a number, in a scene that is ready."""
    spec = SimulationSpec(scene, rig, lasers=1)
    renderer, seconds = Renderer(bench(spec)), seconds_of(spec)
    burning = ["right"] if lit else []

    def picture(k: int) -> bytes:
        return renderer.picture(0.01 * k, burning, seconds).tobytes()

    picture(500)
    return picture


def _one_process(scene: str, rig: str, lit: bool, frames: int) -> None:
    """Print the least processor time of a frame, s, and a digest of the pictures."""
    picture, least, pictures = _camera(scene, rig, lit), float("inf"), hashlib.sha256()
    for k in range(frames // 2):
        begin = time.process_time()
        taken = picture(2 * k)
        least = min(least, time.process_time() - begin)
        pictures.update(taken)
    print(json.dumps((least, pictures.hexdigest()[:8])))


if __name__ == "__main__":
    _one_process(*json.loads(sys.argv[1]))
