"""Mattes as compositors expect them: published hashes, ids that are normal floats, pairs ranked by coverage."""

import json

import numpy as np
import pytest

from karf_engine.export import cryptomatte


@pytest.mark.parametrize(
    "text, expected",
    [
        ("", 0),
        ("hello", 0x248BFA47),
        ("hello, world", 0x149BBB7F),
        ("The quick brown fox jumps over the lazy dog", 0x2E4FF723),
    ],
)
def test_the_hash_is_murmurhash3(text, expected):
    assert cryptomatte.murmur3(text.encode()) == expected


def test_every_id_is_a_normal_number():
    """Programs drop numbers that are none, and may flush those near zero."""
    names = [f"object {number}" for number in range(3000)]
    hashes = np.array([cryptomatte.murmur3(name.encode()) for name in names], np.uint32)
    ids = np.array([cryptomatte.object_id(name) for name in names], np.uint32)
    exponents = ids >> 23 & 255
    assert ((exponents > 0) & (exponents < 255)).all()
    changed = ids != hashes
    assert 0 < changed.sum() < 60 and set((ids ^ hashes)[changed].tolist()) == {1 << 23}


def test_pairs_are_ranked_by_coverage_and_nothing_stands_where_nothing_is():
    coverage = np.zeros((3, 300, 2), np.float16)  # several bands of rows
    coverage[:, 299, 1] = 0.25, 0.125, 0.625
    planes = cryptomatte.channels(["a", "b", "ä"], coverage)
    assert list(planes) == [f"CryptoObject0{layer}.{letter}" for layer in (0, 1) for letter in "RGBA"]
    pairs = [planes[name][299, 1] for name in planes]
    assert pairs[1::2] == [0.625, 0.25, 0.125, 0]
    ids = np.array(pairs[0::2], np.float32).view(np.uint32).tolist()
    assert ids == [*map(cryptomatte.object_id, ("ä", "a", "b")), 0]
    assert not any(plane[:299].any() for plane in planes.values())


def test_the_manifest_names_every_object_as_it_is_called():
    header = cryptomatte.header(["Töpfe no. 1", "mug"])
    (manifest,) = (json.loads(value) for name, value in header.items() if name.endswith("/manifest"))
    assert list(manifest) == ["Töpfe no. 1", "mug"]
    assert int(manifest["mug"], 16) == cryptomatte.object_id("mug")
    assert {name.split("/")[1] for name in header} == {f"{cryptomatte.murmur3(b'CryptoObject'):08x}"[:7]}
