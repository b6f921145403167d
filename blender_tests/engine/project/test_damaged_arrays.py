"""Damaged and hostile npz files: one sentence that names the file, and no memory allocated for claims."""

import random
import struct
import tracemalloc
import zipfile
from io import BytesIO

import numpy as np
import pytest

from karf_engine.errors import DataError
from karf_engine.palettes.color_histogram import read_object_colors
from karf_engine.palettes.compositing import Planes, read_planes, write_planes


def planes_file(path):
    noise = np.random.default_rng(0)
    weights = noise.random((1, 3, 8, 6)).astype(np.float16)
    base = noise.integers(0, 256, (8, 6, 3), np.uint8)
    write_planes(path, Planes(("pot",), weights, weights.sum(1), base))
    return path


def colors_file(path, **changes):
    arrays = {"colors": np.full((5, 3), 0.5, np.float32), "counts": np.ones(5), "palette_weights": np.ones((5, 4)) / 4}
    np.savez_compressed(path, **{f"pot/{name}": array for name, array in (arrays | changes).items()})
    return path


def read_colors(path):
    return read_object_colors(path, "pot")


FILES = {"planes": (planes_file, read_planes), "colors": (colors_file, read_colors)}


def test_whole_files_are_read_as_they_were_written(tmp_path):
    assert read_planes(planes_file(tmp_path / "a.npz")).objects == ("pot",)
    assert [array.shape for array in read_colors(colors_file(tmp_path / "b.npz"))] == [(5, 3), (5,), (5, 4)]


@pytest.mark.parametrize("kind", FILES)
def test_no_damage_of_bytes_ends_in_anything_but_a_sentence(tmp_path, kind):
    """Among the mutants are encrypted members, unknown packings, headers of other types and archives without end."""
    make, read = FILES[kind]
    whole = make(tmp_path / "whole.npz").read_bytes()
    dice, refused = random.Random(1), 0
    for number in range(300):
        content = bytearray(whole)
        for _ in range(dice.choice((1, 1, 2, 8))):
            content[dice.randrange(len(content))] = dice.randrange(256)
        if number % 5 == 0:
            del content[dice.randrange(len(content)) :]
        (tmp_path / "a.npz").write_bytes(content)
        try:
            read(tmp_path / "a.npz")
        except DataError as error:
            refused += 1
            assert str(tmp_path / "a.npz") in error.sentence and error.hint
    assert refused > 112


@pytest.mark.parametrize(("place", "value"), [(0, 1), (2, 99)], ids=["encrypted", "oddly packed"])
def test_members_that_cannot_be_unpacked_are_named(tmp_path, place, value):
    content = bytearray(planes_file(tmp_path / "a.npz").read_bytes())
    for start in [n for n in range(len(content)) if content[n : n + 4] in (b"PK\x01\x02", b"PK\x03\x04")]:
        at = start + (8 if content[start + 2] == 1 else 6) + place
        content[at : at + 2] = struct.pack("<H", value)
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(DataError, match=r"a\.npz \(edit planes\) cannot be read"):
        read_planes(tmp_path / "a.npz")


@pytest.mark.parametrize(("shape", "written"), [((10**12, 3), 0), ((145_000_000,), 580_000_000)])
def test_small_files_that_claim_large_arrays_take_no_memory(tmp_path, shape, written):
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(colors_file(tmp_path / "whole.npz")) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, content in members.items():
            with archive.open(name, "w", force_zip64=True) as stream:
                stream.write(header.getvalue() if name == "pot/colors.npy" else content)
                for _ in range(written // 10**7 if name == "pot/colors.npy" else 0):
                    stream.write(bytes(10**7))
    assert (tmp_path / "a.npz").stat().st_size < 5e6
    tracemalloc.start()
    try:
        with pytest.raises(DataError, match=r"a\.npz \(colors of 'pot'\) cannot be read"):
            read_colors(tmp_path / "a.npz")
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "changes",
    [
        {"colors": np.zeros((5, 4))},
        {"colors": np.zeros((6, 3))},
        {"colors": np.full((5, 3), np.nan)},
        {"colors": np.array([["a"] * 3] * 5)},
        {"counts": np.zeros(5)},
        {"counts": -np.ones(5)},
        {"counts": np.ones(())},
        {"palette_weights": np.ones(5)},
        {"colors": np.zeros((2**19, 3)), "counts": np.ones(2**19), "palette_weights": np.ones((2**19, 1))},
    ],
)
def test_arrays_that_are_no_histogram_are_refused(tmp_path, changes):
    with pytest.raises(DataError, match=r"a\.npz"):
        read_colors(colors_file(tmp_path / "a.npz", **changes))
