"""Learned tensors on disk: exact, and refused when anything about the file is wrong."""

import json
import pickle

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from safetensors.torch import save_file

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import DataError
from karf_engine.io.checkpoints import load_tensors, save_tensors

SCHEMA = "karf-test/1"
TENSORS = {
    "weights": torch.randn(40, 3, generator=torch.Generator().manual_seed(0)),
    "mask": torch.tensor([True, False]),
    "bytes": torch.arange(5, dtype=torch.uint8),
    "view": torch.arange(12.0).view(3, 4).T,
}


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.safetensors"
    save_tensors(path, TENSORS, SCHEMA, {"voxel": 0.1, "objects": ["pot", "lid"]})
    return path


def refusal(path):
    with pytest.raises(DataError) as caught:
        load_tensors(path, SCHEMA)
    assert str(path) in caught.value.sentence and caught.value.hint
    return caught.value.sentence


def test_tensors_and_facts_come_back_exactly(path):
    tensors, facts = load_tensors(path, SCHEMA)
    assert facts == {"voxel": 0.1, "objects": ["pot", "lid"]}
    assert tensors.keys() == TENSORS.keys()
    assert all(
        torch.equal(tensors[name], value) and tensors[name].dtype == value.dtype for name, value in TENSORS.items()
    )


def test_the_same_content_gives_the_same_bytes(path, tmp_path):
    for number in range(8):  # an order that changes would change within a few
        other = tmp_path / f"{number}.safetensors"
        save_tensors(other, TENSORS, SCHEMA, {"voxel": 0.1, "objects": ["pot", "lid"]})
        assert other.read_bytes() == path.read_bytes()


def test_a_file_of_the_first_versions_is_read(path):
    save_file({"weights": TENSORS["weights"]}, path, {"schema": SCHEMA, "facts": json.dumps({"voxel": 0.1})})
    tensors, facts = load_tensors(path, SCHEMA)
    assert torch.equal(tensors["weights"], TENSORS["weights"]) and facts == {"voxel": 0.1}


def test_a_missing_file_says_so(tmp_path):
    assert "does not exist" in refusal(tmp_path / "none.safetensors")


@pytest.mark.parametrize("kept", [0, 4, 100, -1])
def test_a_truncated_file_is_damaged(path, kept):
    path.write_bytes(path.read_bytes()[:kept])
    assert "is damaged" in refusal(path)


def test_a_scrambled_header_is_damaged(path):
    content = bytearray(path.read_bytes())
    content[8:60] = bytes(52)
    path.write_bytes(content)
    assert "is damaged" in refusal(path)


def test_another_schema_is_named(path):
    with pytest.raises(DataError, match="holds 'karf-test/1', not 'karf-test/2'"):
        load_tensors(path, "karf-test/2")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_values_that_are_not_finite_are_refused_by_name(path, value):
    save_tensors(path, TENSORS | {"bad": torch.tensor([0.0, value])}, SCHEMA, {})
    assert "values in 'bad' that are not finite" in refusal(path)


@pytest.mark.parametrize("kind", ["float8_e4m3fn", "float8_e4m3fnuz", "float8_e5m2fnuz"])
def test_numbers_of_a_type_that_cannot_be_checked_are_refused_by_name(path, kind):
    save_tensors(path, TENSORS | {"bad": torch.zeros(4).to(getattr(torch, kind))}, SCHEMA, {})
    assert f"holds 'bad' as torch.{kind}, which is not read" in refusal(path)


@pytest.mark.parametrize("make", NO_FILES)
def test_what_lies_in_place_of_a_file_is_never_waited_for(make, tmp_path):
    make(tmp_path / "a.safetensors")
    assert "not a file" in refusal(tmp_path / "a.safetensors")


class _Trap:
    def __reduce__(self):
        return (pytest.fail, ("the file was unpickled",))


@pytest.mark.parametrize(
    "write", [lambda p: torch.save({"a": _Trap()}, p), lambda p: p.write_bytes(pickle.dumps(_Trap()))]
)
def test_a_pickle_is_refused_and_never_run(path, write):
    write(path)
    assert "is damaged" in refusal(path)


def test_a_failed_save_keeps_the_last_good_file(path):
    before = path.read_bytes()
    with pytest.raises(TypeError):
        save_tensors(path, TENSORS, SCHEMA, {"bad": object()})
    assert path.read_bytes() == before and len(list(path.parent.iterdir())) == 1
