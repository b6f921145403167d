"""Damaged files: a flipped bit, a file that is cut off, empty or gone, and numbers that are none."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from .bench import Bench, Scenario, digest
from .engine import run
from .trial import Trial, trial

Damage = Callable[[Path, random.Random], None]


def damaged_files(bench: Bench, flips: int, few: bool, seed: int) -> Iterator[Trial]:
    """Each file of a complete project is damaged in each way, several times by a flipped bit; few: some in one way."""
    chance = random.Random(seed)
    names = ["project.json", *(name for name in bench.complete.files if not name.startswith("masks/"))]  # the user's
    if few:
        names = ["geometry.safetensors", "palette.json", "object_colors.npz"]
    for name in names:
        for way, tries, damage in [("a flipped bit", 1, flip)] if few else _ways(name, flips):
            for _ in range(tries):
                yield _damaged(bench, name, way, damage, chance)


def _ways(name: str, flips: int) -> list[tuple[str, int, Damage]]:
    ways = [("a flipped bit", flips, flip), ("cut off", 1, cut), ("empty", 1, empty), ("gone", 1, remove)]
    return [*ways, ("NaN", 1, plant_nan)] if name.endswith((".safetensors", ".npz")) else ways


def flip(path: Path, chance: random.Random) -> None:
    data = bytearray(path.read_bytes())
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    path.write_bytes(data)


def cut(path: Path, chance: random.Random) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: chance.randrange(1, len(data))])


def empty(path: Path, chance: random.Random) -> None:
    path.write_bytes(b"")


def remove(path: Path, chance: random.Random) -> None:
    path.unlink()


def plant_nan(path: Path, chance: random.Random) -> None:
    """Put a NaN into one array of floats."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as stored:
            arrays = dict(stored)
        name = chance.choice([name for name, array in arrays.items() if array.dtype.kind == "f"])
        arrays[name].flat[0] = np.nan
        np.savez_compressed(path, **arrays)
        return
    data = bytearray(path.read_bytes())
    start = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:start])
    floats = [entry for name, entry in header.items() if name != "__metadata__" and entry["dtype"] == "F32"]
    first = start + chance.choice(floats)["data_offsets"][0]
    data[first : first + 4] = np.float32(np.nan).tobytes()
    path.write_bytes(data)


def _damaged(bench: Bench, name: str, way: str, damage: Damage, chance: random.Random) -> Trial:
    """Damage a project whose palette is to be learned anew: so that every file has a reader."""
    anew = bench.anew("palette")
    bench.restore(anew.start)
    damage(bench.project / name, chance)
    kept = bench.folder / "damaged"
    shutil.rmtree(kept, ignore_errors=True)
    shutil.copytree(bench.project, kept)
    lost, flaws, seen = _used(bench, anew, name)
    bench.restore(kept)
    rerun = _mended(bench, name)
    return trial(f"a file is damaged: {way}", name, lost, *flaws, rerun, seen=seen)


def _used(bench: Bench, anew: Scenario, name: str) -> tuple[str | None, list[str | None], str]:
    """Render, solve an edit and extract a palette: each must be refused, or give what it gave without damage."""
    pictures, shown = bench.pictures(planes=True)
    solved = run(bench.match)
    edit = digest(bench.look / "edit.json") if solved.code == 0 else None
    learned = run(anew.command)
    lost = None
    if shown.code == 0 and pictures != bench.complete.pictures:
        lost = "a render silently gives other pictures"
    elif solved.code == 0 and edit != bench.edit:
        lost = "an edit silently comes out different"
    elif learned.code == 0 and bench.differs(anew.end, but=name):
        lost = f"a palette is silently learned differently: {bench.differs(anew.end, but=name)}"
    runs = (shown, solved, learned)
    seen = next((one.sentence for one in runs if one.code), "")
    return lost, [one.flaw for one in runs], seen


def _mended(bench: Bench, name: str) -> str | None:
    """Whether learning everything once more makes the project right again; a lost project.json cannot be told of."""
    for stage in ("geometry", "segmentation", "palette", "recoloring"):
        done = run(bench.command(stage))
        if done.code:
            refused = name == "project.json" and done.flaw is None
            return None if refused else f"learning again fails: {done.flaw or done.sentence}"
    wrong = bench.differs(bench.complete) or bench.lost()
    return f"learning again ends, but does not mend it: {wrong}" if wrong else None
