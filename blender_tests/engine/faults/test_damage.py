"""Damaged files and files of a newer version are rejected or harmless, and a rerun repairs them."""

import json
import shutil

import numpy as np
import pytest

from blender_tests.engine.faults.bench import digest
from blender_tests.engine.faults.engine import run
from blender_tests.engine.readers.samples import renew_checksum
from karf_engine.project import STAGE_ORDER

FEW_FILES = ("geometry/geometry.safetensors", "recoloring/palette.json", "recoloring/object_colors.npz")
FLIPS = 6  # in each file


def flip(path, chance):
    data = bytearray(path.read_bytes())
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    path.write_bytes(data)


def truncate(path, chance):
    data = path.read_bytes()
    path.write_bytes(data[: chance.randrange(1, len(data))])


def plant_nan(path, chance):
    """Put a NaN into one float array."""
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


DAMAGES = {
    "flipped bit": flip,
    "truncated": truncate,
    "empty": lambda path, _: path.write_bytes(b""),
    "missing": lambda path, _: path.unlink(),
    "NaN": plant_nan,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_file_never_changes_a_result(bench, few, chance, subtests, damage):
    """The project's palette stage must run again, so every file has a reader."""
    if few and damage != "flipped bit":
        pytest.skip("only with --all-faults")
    names = ["project.json", *(name for name in bench.complete.files if not name.startswith("masks/"))]  # the user's
    if damage == "NaN":
        names = [name for name in names if name.endswith((".safetensors", ".npz"))]
    for name in FEW_FILES if few else names:
        for number in range(FLIPS if damage == "flipped bit" and not few else 1):
            with subtests.test(file=name, number=number):
                bench.restore(bench.rerun("palette").start)
                DAMAGES[damage](bench.path(name), chance)
                damaged = bench.folder / "damaged"
                shutil.rmtree(damaged, ignore_errors=True)
                shutil.copytree(bench.project, damaged)
                assert_rejected_or_harmless(bench, name)
                bench.restore(damaged)
                assert_rerun_repairs(bench, name)


def assert_rejected_or_harmless(bench, name):
    """Assert that render, match and palette each fail or give the undamaged result."""
    scenario = bench.rerun("palette")
    pictures, rendered = bench.pictures(planes=True)
    matched = run(bench.match)
    edit = digest(bench.look / "edit.json") if matched.code == 0 else None
    extracted = run(scenario.command)
    assert [ended.flaw for ended in (rendered, matched, extracted)] == [None] * 3
    assert rendered.code or pictures == bench.complete.pictures
    assert matched.code or edit == bench.edit
    assert extracted.code or not bench.differences(scenario.end, except_for=name)


def assert_rerun_repairs(bench, name):
    """Assert that running every stage repairs the project; it may fail if project.json is damaged."""
    for stage in STAGE_ORDER:
        done = run(bench.command(stage))
        if done.code and name == "project.json" and done.flaw is None:
            return
        assert done.code == 0, done.text
    assert not bench.differences(bench.complete)
    bench.assert_valid()


@pytest.mark.parametrize("name", ["project.json", "geometry/capture.json", "recoloring/palette.json"])
def test_newer_file_version_is_rejected_without_changes(bench, name):
    def contents():
        return bench.files() | {"project.json": digest(bench.project / "project.json")}

    scenario = bench.rerun("palette")  # reads what no render reads
    bench.restore(scenario.start)
    path = bench.path(name)
    content = json.loads(path.read_text())
    content.pop("checksum", None)  # without it the content is trusted
    path.write_text(json.dumps(content | {"schema": content["schema"].rpartition("/")[0] + "/99"}))
    renew_checksum(bench.project, path)
    before = contents()
    rendered, extracted = run(bench.render("--planes")), run(scenario.command)
    assert (rendered.flaw, extracted.flaw) == (None, None)
    assert rendered.code or extracted.code, "it is read as if it were of this version"
    if rendered.code and extracted.code:
        assert {file: digest for file, digest in contents().items() if file in before} == before
