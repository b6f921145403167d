"""Damaged files, and files of a newer version: refused in a sentence or without consequence, and never another picture."""

import json
import shutil

import numpy as np
import pytest

from blender_tests.engine.faults.bench import digest
from blender_tests.engine.faults.engine import run
from blender_tests.engine.readers.samples import renew_checksum
from karf_engine.project import STAGE_ORDER

SOME = ("geometry/geometry.safetensors", "recoloring/palette.json", "recoloring/object_colors.npz")
FLIPS = 6  # of a bit, in each file


def flip(path, chance):
    data = bytearray(path.read_bytes())
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    path.write_bytes(data)


def cut(path, chance):
    data = path.read_bytes()
    path.write_bytes(data[: chance.randrange(1, len(data))])


def empty(path, chance):
    path.write_bytes(b"")


def remove(path, chance):
    path.unlink()


def plant_nan(path, chance):
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


WAYS = {"a flipped bit": flip, "cut off": cut, "empty": empty, "gone": remove, "NaN": plant_nan}


@pytest.mark.parametrize("way", WAYS)
def test_a_damaged_file_is_told_of_and_never_another_picture(bench, few, chance, subtests, way):
    """The palette of the project is to be learned anew: so that every file has a reader."""
    if few and way != "a flipped bit":
        pytest.skip("thrown with --all-faults")
    names = ["project.json", *(name for name in bench.complete.files if not name.startswith("masks/"))]  # the user's
    if way == "NaN":
        names = [name for name in names if name.endswith((".safetensors", ".npz"))]
    for name in SOME if few else names:
        for number in range(FLIPS if way == "a flipped bit" and not few else 1):
            with subtests.test(file=name, number=number):
                bench.restore(bench.anew("palette").start)
                WAYS[way](bench.path(name), chance)
                kept = bench.folder / "damaged"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(bench.project, kept)
                is_refused_or_without_consequence(bench, name)
                bench.restore(kept)
                is_mended_by_learning_again(bench, name)


def is_refused_or_without_consequence(bench, name):
    """Render, solve an edit and extract a palette: each gives what it gave without damage, if it gives anything."""
    anew = bench.anew("palette")
    pictures, shown = bench.pictures(planes=True)
    solved = run(bench.match)
    edit = digest(bench.look / "edit.json") if solved.code == 0 else None
    learned = run(anew.command)
    assert [one.flaw for one in (shown, solved, learned)] == [None] * 3
    assert shown.code or pictures == bench.complete.pictures
    assert solved.code or edit == bench.edit
    assert learned.code or not bench.differs(anew.end, but=name)


def is_mended_by_learning_again(bench, name):
    """A lost project.json alone cannot be told of."""
    for stage in STAGE_ORDER:
        done = run(bench.command(stage))
        if done.code and name == "project.json" and done.flaw is None:
            return
        assert done.code == 0, done.text
    assert not bench.differs(bench.complete)
    bench.is_right()


@pytest.mark.parametrize("name", ["project.json", "geometry/capture.json", "recoloring/palette.json"])
def test_a_file_of_a_newer_version_is_refused_and_nothing_is_changed(bench, name):
    def contents():
        return bench.files() | {"project.json": digest(bench.project / "project.json")}

    scenario = bench.anew("palette")  # reads what no render reads
    bench.restore(scenario.start)
    path = bench.path(name)
    content = json.loads(path.read_text())
    content.pop("checksum", None)  # without it what it says is believed
    path.write_text(json.dumps(content | {"schema": content["schema"].rpartition("/")[0] + "/99"}))
    renew_checksum(bench.project, path)
    before = contents()
    shown, learned = run(bench.render("--planes")), run(scenario.command)
    assert (shown.flaw, learned.flaw) == (None, None)
    assert shown.code or learned.code, "it is taken as if it were of this version"
    if shown.code and learned.code:
        assert {file: digest for file, digest in contents().items() if file in before} == before
