"""Checkpoints of a few bytes that claim gigabytes are refused before memory is taken for them."""

import zipfile
from collections import OrderedDict

import pytest

pytest.importorskip("torch")

import torch

from blender_tests.engine.reference.memory import little_memory
from karf_engine.errors import DataError
from karf_engine.fields.nerf.files import read_nerf


class Bytes:
    def __reduce__(self):
        return bytearray, (3 << 30,)


def of_bytes(path):
    torch.save({"network_fn_state_dict": {"a": Bytes()}}, path)


def of_bytes_in_an_old_file(path):
    torch.save({"network_fn_state_dict": {"a": Bytes()}}, path, _use_new_zipfile_serialization=False)


def of_one_number(path):
    weights = torch.zeros(1).expand(30_000, 30_000)
    state = OrderedDict({"pts_linears.0.weight": weights, "views_linears.0.weight": weights})
    torch.save({"network_fn_state_dict": state}, path)


def of_no_numbers(path):
    state = {f"{layer}_linears.0.weight": torch.zeros(60_000, 0) for layer in ("pts", "views")}
    torch.save({"network_fn_state_dict": state}, path)


def of_packed_zeros(path):
    plain = path.with_suffix(".plain")
    torch.save({"network_fn_state_dict": {"a": torch.zeros(20_000_000)}}, plain)
    with zipfile.ZipFile(plain) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed:
        for record in source.infolist():
            with source.open(record) as file, packed.open(record.filename, "w", force_zip64=True) as out:
                while part := file.read(1 << 20):
                    out.write(part)
    plain.unlink()


CASES = {
    "a.tar": (of_bytes, "asks for __builtin__.bytearray|asks for builtins.bytearray"),
    "b.tar": (of_bytes_in_an_old_file, "asks for __builtin__.bytearray|asks for builtins.bytearray"),
    "c.tar": (of_one_number, "repeat a few numbers"),
    "d.tar": (of_no_numbers, "a network of another kind"),
    "e.tar": (of_packed_zeros, "records are packed"),
}


@pytest.mark.parametrize("name", CASES)
def test_claims_beyond_the_file_are_refused_without_taking_memory(tmp_path, name):
    make, words = CASES[name]
    make(tmp_path / name)
    with little_memory(), pytest.raises(DataError, match=words) as caught:
        read_nerf(tmp_path / name)
    assert str(tmp_path / name) in caught.value.sentence and caught.value.hint


def test_what_is_no_file_in_place_of_a_checkpoint_is_named(tmp_path):
    (tmp_path / "a.tar").symlink_to("/dev/zero")
    with pytest.raises(DataError, match="is a pipe or a device, not a file"):
        read_nerf(tmp_path / "a.tar")
