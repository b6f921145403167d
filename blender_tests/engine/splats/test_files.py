"""Learned Gaussians on disk: exact round trips, and rejection of damaged files."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_array_equal

pytest.importorskip("numba")

from safetensors import safe_open
from safetensors.torch import save_file

from blender_tests.engine.splats.clouds import BACKGROUND, NEAR, camera_ahead, cloud
from karf_engine.errors import DataError
from karf_engine.splats.files import SCHEMA, load_all_gaussians, load_gaussians, save_gaussians
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, PLAIN_FILTER
from karf_engine.splats.rasterizer import rasterize

FACTS = {"n_behind": 7, "background": list(BACKGROUND), "near": NEAR}
SEEN = np.random.default_rng(0).random((30, 5), np.float32)


def gaussians(degree=2, **more):
    return Gaussians(cloud(30, degree), 7, BACKGROUND, NEAR, **more)


def assert_rejected(path):
    with pytest.raises(DataError, match=r"splats\.safetensors") as caught:
        load_gaussians(path)
    assert caught.value.hint and len(caught.value.sentence) < 1000


@pytest.fixture
def path(tmp_path):
    return tmp_path / "splats.safetensors"


@pytest.mark.parametrize(
    ("saved", "version"),
    [
        *((gaussians(degree), 1) for degree in range(4)),
        (gaussians(visibility=SEEN), 1),
        (gaussians(screen_filter=PLAIN_FILTER), 2),
        (gaussians(screen_filter=ANTIALIASED_FILTER), 2),
    ],
    ids=["degree 0", "degree 1", "degree 2", "degree 3", "visibility", "plain", "antialiased"],
)
def test_saved_gaussians_are_read_back_exactly(path, saved, version):
    save_gaussians(saved, path)
    found = load_gaussians(path)
    assert_array_equal(found.table, saved.table)
    assert_array_equal(found.visibility, saved.visibility)
    assert found == replace(saved, table=found.table, visibility=found.visibility)
    assert (found.n_foreground, len(found), 11 + 3 * (found.degree + 1) ** 2) == (23, *found.table.shape)
    with safe_open(path, "pt") as stored:
        metadata = json.loads(stored.metadata()["karf"])
    assert metadata["schema"] == f"karf-splats/{version}", "older engines would apply their own filter"
    assert version == 2 or metadata["facts"] == FACTS
    before = path.read_bytes()
    save_gaussians(saved, path)
    assert path.read_bytes() == before


TABLES = {
    "one axis": torch.zeros(30),
    "three axes": torch.zeros(30, 14, 2),
    **{f"{width} columns": torch.zeros(30, width) for width in (11, 13, 17, 11 + 3 * 25)},
    "double precision": torch.zeros(30, 14, dtype=torch.float64),
    "whole numbers": torch.zeros(30, 14, dtype=torch.int32),
    "fewer rows than background": torch.zeros(6, 14),
}
WRONG_FACTS = [
    *({"n_behind": value} for value in (-1, 31, 2.5, None)),
    *({"near": value} for value in (0, -1, "close", 1e999)),
    *({"background": value} for value in ([0, 0], 5, ["nan", 0, 0], [1e999, 0, 0])),
    *({"screen_filter": value} for value in ([0, 1], [0.3, 2], [0.3])),
]
DAMAGES = [
    *({"tensors": {"table": table}} for table in TABLES.values()),
    *({"facts": FACTS | change} for change in WRONG_FACTS),
    *({"facts": {key: FACTS[key] for key in FACTS if key != missing}} for missing in FACTS),
    {"schema": "karf-splats/9"},
    {"tensors": {"tables": torch.from_numpy(cloud(30, 2))}},
]
IDS = [*TABLES, *map(str, WRONG_FACTS), *(f"no {name}" for name in FACTS), "schema", "tensor name"]


@pytest.mark.parametrize("damage", DAMAGES, ids=IDS)
def test_invalid_contents_are_rejected(path, damage):
    header = {"schema": damage.get("schema", SCHEMA), "facts": damage.get("facts", FACTS)}
    text = json.dumps(header).replace("Infinity", "1e999")
    save_file(damage.get("tensors", {"table": torch.from_numpy(cloud(30, 2))}), path, {"karf": text})
    assert_rejected(path)


ERASED = np.arange(30) % 3 == 0


def test_erased_gaussians_are_left_out_but_kept_in_the_file(path):
    whole = gaussians(visibility=SEEN)
    save_gaussians(whole, path, ERASED)
    found, (everything, erased) = load_gaussians(path), load_all_gaussians(path)
    assert_array_equal(found.table, whole.table[~ERASED])
    assert_array_equal(found.visibility, SEEN[~ERASED])
    assert found.n_background == 5, "of 7 the rows 24 and 27 are erased"
    assert_array_equal(everything.table, whole.table)
    assert_array_equal(erased, ERASED)
    with safe_open(path, "pt") as stored:
        assert json.loads(stored.metadata()["karf"])["schema"] == "karf-splats/3", "older engines would show them"


@pytest.mark.parametrize("erased", [ERASED[:29], ERASED.astype(np.uint8)], ids=["rows", "type"])
def test_mismatched_erased_rows_are_rejected(path, erased):
    save_gaussians(gaussians(), path, erased)
    assert_rejected(path)


@pytest.mark.parametrize(
    "visibility", [SEEN[:29], SEEN[:, :4].copy(), SEEN.astype(float)], ids=["rows", "columns", "type"]
)
def test_mismatched_visibility_is_rejected(path, visibility):
    save_gaussians(gaussians(visibility=visibility), path)
    assert_rejected(path)


def test_any_finite_numbers_can_be_rendered(path):
    random, strange = np.random.default_rng(0), gaussians()
    powers = random.uniform(-38, 38, strange.table.shape)
    strange.table[:] = (random.choice((-1, 1), powers.shape) * 10.0**powers).astype(np.float32)
    save_gaussians(strange, path)
    view = rasterize(load_gaussians(path), camera_ahead())
    assert view.image.shape == (36, 40, 4)
    view.blended(view.colors)
