"""How long a preview of any camera takes in a worker: from query to answer, with its file, on one thread."""

from __future__ import annotations

import itertools
import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from karf_engine.capture.transforms import camera_to_json
from karf_engine.compute.progress import peak_memory_bytes
from karf_engine.worker.queries.renders import preview
from karf_engine.worker.queries.session import Session
from tools.speed.rows import Row

SIDES = (96, 256, 512)  # pixels of the long side; Live Camera begins with the first
TARGET_MS = 500.0  # of the first
REPEATS = 3


def run(project: Path) -> list[Row]:
    """Loading, the first picture, and the medians of each size, through captured cameras."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="karf-preview-") as folder:
        session = Session(Path(folder), threads=1, device="cpu")
        rows.append(_measured("load", 0, lambda: session.model(str(project)), 1))
        views = itertools.cycle(session.model(str(project)).capture.views)

        def ask(side: int) -> None:
            camera = next(views).camera.without_distortion()
            factor = side / max(camera.width, camera.height)
            camera = camera.scaled(round(camera.width * factor), round(camera.height * factor))
            preview(session, {"project": str(project), "camera": camera_to_json(camera), "long_side": side})

        rows.append(_measured("first", SIDES[0], lambda: ask(SIDES[0]), 1))
        rows += [_measured("preview", side, partial(ask, side), REPEATS) for side in SIDES]
    return rows


def _measured(what: str, side: int, call: Callable[[], object], repeats: int) -> Row:
    spent, passed = [], []
    for _ in range(repeats):
        process, wall = time.process_time(), time.perf_counter()
        call()
        spent.append(time.process_time() - process)
        passed.append(time.perf_counter() - wall)
    return {
        "what": what,
        "side": side,
        "process_ms": round(1000 * statistics.median(spent)),
        "wall_ms": round(1000 * statistics.median(passed)),
        "peak_gib": round(peak_memory_bytes() / 2**30, 2),
    }
