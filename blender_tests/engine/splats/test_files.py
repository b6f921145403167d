"""Learned Gaussians on disk: what is written is read again; what is damaged or made up is refused in a sentence."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from safetensors import safe_open
from safetensors.torch import save_file

from blender_tests.engine.reference.memory import little_memory
from blender_tests.engine.splats.clouds import BACKGROUND, NEAR, cloud
from karf_engine.errors import DataError
from karf_engine.io.checkpoints import save_tensors
from karf_engine.splats.files import SCHEMA, load_gaussians, save_gaussians
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, PLAIN_FILTER

FACTS = {"n_behind": 7, "background": list(BACKGROUND), "near": NEAR}


def gaussians(degree=2):
    return Gaussians(cloud(30, degree), 7, BACKGROUND, NEAR)


def refused(path):
    with pytest.raises(DataError, match=r"splats\.safetensors") as caught:
        load_gaussians(path)
    assert caught.value.hint and len(caught.value.sentence) < 1000


@pytest.fixture
def path(tmp_path):
    return tmp_path / "splats.safetensors"


@pytest.mark.parametrize("degree", range(4))
def test_what_is_written_is_read_again_bit_by_bit(path, degree):
    save_gaussians(gaussians(degree), path)
    found = load_gaussians(path)
    assert_array_equal(found.table, gaussians(degree).table)
    assert found == replace(gaussians(degree), table=found.table)
    assert (found.degree, found.n_foreground, len(found)) == (degree, 23, 30)


def test_how_photos_look_at_them_is_kept(path):
    looks = np.random.default_rng(0).random((30, 5), np.float32)
    save_gaussians(replace(gaussians(), visibility=looks), path)
    assert_array_equal(load_gaussians(path).visibility, looks)


@pytest.mark.parametrize("looks", [np.zeros((29, 5), np.float32), np.zeros((30, 4), np.float32), np.zeros((30, 5))])
def test_looks_of_other_gaussians_are_refused(path, looks):
    save_gaussians(replace(gaussians(), visibility=looks), path)
    refused(path)


@pytest.mark.parametrize("screen_filter", [PLAIN_FILTER, ANTIALIASED_FILTER])
def test_the_screen_filter_of_another_program_is_kept(path, screen_filter):
    save_gaussians(replace(gaussians(), screen_filter=screen_filter), path)
    assert load_gaussians(path).screen_filter == screen_filter
    assert schema_of(path) == "karf-splats/2", "older engines would take the filter for their own"


def test_where_nothing_is_new_the_file_is_as_older_engines_know_it(path):
    save_gaussians(gaussians(), path)
    with safe_open(path, "pt") as stored:
        assert json.loads(stored.metadata()["karf"]) == {"schema": "karf-splats/1", "facts": FACTS}


def schema_of(path):
    with safe_open(path, "pt") as stored:
        return json.loads(stored.metadata()["karf"])["schema"]


def test_equal_gaussians_become_equal_bytes(path, tmp_path):
    save_gaussians(gaussians(), path)
    save_gaussians(gaussians(), tmp_path / "again.safetensors")
    assert path.read_bytes() == (tmp_path / "again.safetensors").read_bytes()


@pytest.mark.parametrize("length", [0, 7, 100, -1])
def test_a_file_that_is_cut_off_is_damaged(path, length):
    save_gaussians(gaussians(), path)
    path.write_bytes(path.read_bytes()[:length])
    refused(path)


def test_a_missing_file_names_what_writes_it(path):
    refused(path)


@pytest.mark.parametrize(
    "table",
    [
        torch.zeros(30),
        torch.zeros(30, 11),
        torch.zeros(30, 13),
        torch.zeros(30, 17),
        torch.zeros(30, 14, 2),
        torch.zeros(30, 11 + 3 * 25),
        torch.zeros(30, 14, dtype=torch.float64),
        torch.zeros(30, 14, dtype=torch.int32),
        torch.zeros(6, 14),
        torch.full((30, 14), torch.nan),
        torch.full((30, 14), torch.inf),
    ],
    ids=lambda table: f"{list(table.shape)} {table.dtype} {float(table.reshape(-1)[0])}",
)
def test_tables_that_hold_no_gaussians_are_refused(path, table):
    save_tensors(path, {"table": table}, SCHEMA, FACTS)
    refused(path)


@pytest.mark.parametrize(
    "change",
    [
        {"n_behind": -1},
        {"n_behind": 31},
        {"n_behind": 2.5},
        {"n_behind": None},
        {"near": 0},
        {"near": -1},
        {"near": "close"},
        {"near": 1e999},
        {"background": [0, 0]},
        {"background": 5},
        {"screen_filter": [0, 1]},
        {"screen_filter": [0.3, 2]},
        {"screen_filter": [0.3]},
        {"background": ["nan", 0, 0]},
        {"background": [1e999, 0, 0]},
    ],
    ids=str,
)
def test_facts_that_nobody_wrote_are_refused(path, change):
    header = json.dumps({"schema": SCHEMA, "facts": FACTS | change}).replace("Infinity", "1e999")
    save_file({"table": torch.from_numpy(cloud(30, 2))}, path, {"karf": header})
    refused(path)


@pytest.mark.parametrize("name", FACTS)
def test_facts_that_are_missing_are_refused(path, name):
    facts = {key: value for key, value in FACTS.items() if key != name}
    save_tensors(path, {"table": torch.from_numpy(cloud(30, 2))}, SCHEMA, facts)
    refused(path)


def test_another_schema_or_another_tensor_is_refused(path):
    save_tensors(path, {"table": torch.from_numpy(cloud(30, 2))}, "karf-splats/9", FACTS)
    refused(path)
    save_tensors(path, {"tables": torch.from_numpy(cloud(30, 2))}, SCHEMA, FACTS)
    refused(path)


def test_a_claim_of_gigabytes_in_a_few_bytes_takes_no_memory(path):
    size = 4 * 14 * 500_000_000
    entry = {"table": {"dtype": "F32", "shape": [500_000_000, 14], "data_offsets": [0, size]}}
    header = json.dumps(entry | {"__metadata__": {"karf": json.dumps({"schema": SCHEMA, "facts": FACTS})}}).encode()
    path.write_bytes(len(header).to_bytes(8, "little") + header + bytes(64))
    with little_memory():
        refused(path)


def test_numbers_of_no_size_show_something_or_nothing_but_never_fail(path):
    """A stranger's file may hold any finite numbers."""
    from blender_tests.engine.splats.clouds import camera_ahead
    from karf_engine.splats.rasterizer import rasterize

    random = np.random.default_rng(0)
    strange = gaussians()
    powers = random.uniform(-38, 38, strange.table.shape)
    strange.table[:] = (random.choice((-1, 1), powers.shape) * 10.0**powers).astype(np.float32)
    save_gaussians(strange, path)
    view = rasterize(load_gaussians(path), camera_ahead())
    assert view.image.shape == (36, 40, 4)
    view.blended(view.colors)
