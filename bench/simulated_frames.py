"""Frames per second of the simulator: whole camera pictures, speckle and noise included.

Each frame is at a new table angle. Beside the clock stands the least processor time of a frame,
which says the same on a busy machine, and a digest of the pictures: it is the same at two commits
whose simulators are, on one machine.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import resource
import time

from turnscan.simulate import Renderer, SimulationSpec, bench, seconds_of

_SCENES = (
    ("cup", "paper", True, 24),
    ("cup", "paper", False, 48),
    ("head", "paper", True, 16),
    ("sphere", "modern", True, 6),
)
_SIZE = {"paper": "640 x 480", "modern": "2448 x 2048"}


def run() -> None:
    """Print frames per second of one process and of two."""
    print(
        f"{'scene, rig':<34}{'one process':>12}{'two':>9}{'memory':>10}{'processor':>16}  pictures"
    )
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
            rates.append(processes * frames / max(seconds for seconds, *_ in done))
            if processes == 1:
                _, _, used, digest = done[0]
        size = max(memory for _, memory, *_ in done)
        label = f"{scene}{'' if lit else ' (dark)'}, {rig}, {_SIZE[rig]}"
        print(
            f"{label:<34}{rates[0]:>8.1f} /s{rates[1]:>7.1f}/s{size:>7.0f} MB"
            f"{1e3 * used:>7.1f} ms/frame  {digest}"
        )


def _work(
    scene: str, rig: str, lit: bool, first: int, frames: int, barrier: object, queue: object
) -> None:
    wish = SimulationSpec(scene, rig, lasers=1)
    renderer = Renderer(bench(wish))
    seconds = seconds_of(wish)
    burning = ["right"] if lit else []
    renderer.picture(5.0, burning, seconds)
    barrier.wait()  # type: ignore[attr-defined]
    start, least, pictures = time.perf_counter(), float("inf"), hashlib.sha256()
    for k in range(frames):
        begin = time.process_time()
        picture = renderer.picture(0.01 * (2 * k + first), burning, seconds)
        least = min(least, time.process_time() - begin)
        pictures.update(picture.tobytes())
    spent = time.perf_counter() - start
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    queue.put((spent, memory, least, pictures.hexdigest()[:8]))  # type: ignore[attr-defined]


if __name__ == "__main__":
    run()
