"""Files of tensors and arrays: exact round trips, named errors for malformed files, bounded memory."""

import json
import pickle
import struct
import tracemalloc
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import DataError
from karf_engine.io.checkpoints import load_tensors, save_tensors
from karf_engine.palettes.color_histogram import read_object_colors
from karf_engine.palettes.compositing import Planes, read_planes, write_planes

SCHEMA = "karf-test/1"
FACTS = {"voxel": 0.1, "objects": ["pot", "lid"]}
TENSORS = {
    "weights": torch.randn(40, 3, generator=torch.Generator().manual_seed(0)),
    "mask": torch.tensor([True, False]),
    "bytes": torch.arange(5, dtype=torch.uint8),
    "view": torch.arange(12.0).view(3, 4).T,
}


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.safetensors"
    save_tensors(path, TENSORS, SCHEMA, FACTS)
    return path


class Trap:
    def __reduce__(self):
        return (pytest.fail, ("the file was unpickled",))


def cut_to(kept):
    return lambda path: path.write_bytes(path.read_bytes()[:kept])


def damage_header(path):
    content = path.read_bytes()
    path.write_bytes(content[:8] + bytes(52) + content[60:])


def with_bad(value):
    return lambda path: save_tensors(path, TENSORS | {"bad": value}, SCHEMA, {})


def replace_by(make):
    return lambda path: (path.unlink(), make(path))


MALFORMED = {
    "missing": (Path.unlink, "does not exist"),
    **{f"cut to {kept}": (cut_to(kept), "is damaged") for kept in (0, 4, 100, -1)},
    "damaged header": (damage_header, "is damaged"),
    "torch file": (lambda path: torch.save({"a": Trap()}, path), "is damaged"),
    "pickle": (lambda path: path.write_bytes(pickle.dumps(Trap())), "is damaged"),
    "schema": (lambda path: save_tensors(path, TENSORS, "karf-test/2", {}), "holds 'karf-test/2', not 'karf-test/1'"),
    **{
        name: (with_bad(torch.tensor([0, float(name)])), "values in 'bad' that are not finite")
        for name in ("nan", "inf")
    },
    **{
        kind: (with_bad(torch.zeros(4).to(getattr(torch, kind))), f"holds 'bad' as torch.{kind}, which is not read")
        for kind in ("float8_e4m3fn", "float8_e4m3fnuz", "float8_e5m2fnuz")
    },
    **{f"not a file {number}": (replace_by(make), "not a file") for number, make in enumerate(NO_FILES)},
}


@pytest.mark.parametrize(("change", "sentence"), MALFORMED.values(), ids=MALFORMED)
def test_malformed_tensor_files_are_rejected(path, change, sentence):
    change(path)
    with pytest.raises(DataError) as caught:
        load_tensors(path, SCHEMA)
    assert str(path) in caught.value.sentence and sentence in caught.value.sentence and caught.value.hint


def test_tensors_and_facts_survive_and_leave_the_file_unmapped(path):
    tensors, facts = load_tensors(path, SCHEMA)
    assert facts == FACTS and tensors.keys() == TENSORS.keys()
    for name, value in TENSORS.items():
        assert torch.equal(tensors[name], value) and tensors[name].dtype == value.dtype
    mapped = Path("/proc/self/maps")
    assert not mapped.exists() or str(path) not in mapped.read_text()


def test_equal_content_gives_equal_bytes(path, tmp_path):
    for number in range(8):  # enough to notice an unstable order
        other = tmp_path / f"{number}.safetensors"
        save_tensors(other, TENSORS, SCHEMA, FACTS)
        assert other.read_bytes() == path.read_bytes()


def test_file_of_first_versions_is_read(path):
    save_file({"weights": TENSORS["weights"]}, path, {"schema": SCHEMA, "facts": json.dumps({"voxel": 0.1})})
    tensors, facts = load_tensors(path, SCHEMA)
    assert torch.equal(tensors["weights"], TENSORS["weights"]) and facts == {"voxel": 0.1}


def test_failed_save_keeps_the_last_good_file(path):
    before = path.read_bytes()
    with pytest.raises(TypeError):
        save_tensors(path, TENSORS, SCHEMA, {"bad": object()})
    assert path.read_bytes() == before and len(list(path.parent.iterdir())) == 1


@pytest.mark.parametrize(("place", "value"), [(0, 1), (2, 99)], ids=["encrypted", "oddly packed"])
def test_unreadable_archives_are_rejected(tmp_path, place, value):
    path, weights = tmp_path / "a.npz", np.ones((1, 3, 8, 6), np.float16)
    write_planes(path, Planes(("pot",), weights, weights.sum(1), np.zeros((8, 6, 3), np.uint8)))
    content = bytearray(path.read_bytes())
    for start in [n for n in range(len(content)) if content[n : n + 4] in (b"PK\x01\x02", b"PK\x03\x04")]:
        at = start + (8 if content[start + 2] == 1 else 6) + place
        content[at : at + 2] = struct.pack("<H", value)
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"a\.npz \(edit planes\) cannot be read"):
        read_planes(path)


HISTOGRAM = {"colors": np.full((5, 3), 0.5, np.float32), "counts": np.ones(5), "palette_weights": np.ones((5, 4)) / 4}


@pytest.mark.parametrize(("shape", "written"), [((10**12, 3), 0), ((145_000_000,), 580_000_000)])
def test_false_array_sizes_do_not_allocate_memory(tmp_path, shape, written):
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f4", "fortran_order": False, "shape": shape})
    np.savez(tmp_path / "a.npz", **{f"pot/{name}": HISTOGRAM[name] for name in ("counts", "palette_weights")})
    with (
        zipfile.ZipFile(tmp_path / "a.npz", "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("pot/colors.npy", "w", force_zip64=True) as stream,
    ):
        stream.write(header.getvalue())
        for _ in range(written // 10**7):
            stream.write(bytes(10**7))
    assert (tmp_path / "a.npz").stat().st_size < 5e6
    tracemalloc.start()
    try:
        with pytest.raises(DataError, match=r"a\.npz \(colors of 'pot'\) cannot be read"):
            read_object_colors(tmp_path / "a.npz", "pot")
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
def test_malformed_histograms_are_rejected(tmp_path, changes):
    np.savez_compressed(tmp_path / "a.npz", **{f"pot/{name}": each for name, each in (HISTOGRAM | changes).items()})
    with pytest.raises(DataError, match=r"a\.npz"):
        read_object_colors(tmp_path / "a.npz", "pot")
