"""Networks of bmild/nerf become an equal checkpoint of nerf-pytorch, without running code from the file."""

import pickle
import struct

import numpy as np
import pytest
import torch

from blender_tests.engine.reference.checkpoints import Trap, bmild_arrays, vanilla_state, write_arrays
from blender_tests.engine.reference.memory import little_memory
from karf_engine.errors import DataError
from karf_engine.fields.nerf.importing import read_nerf
from tools.convert_bmild import main, read_bmild

FILES = ("model_200000.npy", "model_fine_200000.npy")
COARSE, FINE = vanilla_state(1), vanilla_state(2)
ARRAYS = bmild_arrays(COARSE)


@pytest.fixture
def model(tmp_path):
    return tmp_path / FILES[0]


def assert_converted(given, *states):
    """Convert a file and compare both networks, as the engine reads them, with these tensors."""
    out = given.with_name("out") / "200000.tar"
    assert main([str(given), str(out)]) == 0
    for network, state in zip(read_nerf(out), states, strict=True):
        shape, found = network.shape, network.state_dict()
        assert shape.skips == (5,) and not shape.linear_first and not shape.rectified_features
        assert found.keys() == state.keys() and all(torch.equal(found[name], value) for name, value in state.items())


@pytest.mark.parametrize("protocol", [None, 2])
@pytest.mark.parametrize("given", FILES)
def test_both_networks_are_converted_exactly(tmp_path, given, protocol):
    for name, state in zip(FILES, (COARSE, FINE), strict=True):
        write_arrays(tmp_path / name, bmild_arrays(state), protocol)
    assert_converted(tmp_path / given, COARSE, FINE)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("arrays", [ARRAYS, [np.asfortranarray(array.astype(">f8")) for array in ARRAYS]])
def test_single_file_serves_as_both_networks(tmp_path, name, arrays):
    write_arrays(tmp_path / name, arrays)
    assert_converted(tmp_path / name, COARSE, COARSE)


def test_checkpoint_is_reproducible_and_has_only_tensors(tmp_path, model):
    write_arrays(model, ARRAYS)
    for name in ("a.tar", "b.tar"):
        assert main([str(model), str(tmp_path / name)]) == 0
    content = torch.load(tmp_path / "a.tar", weights_only=True)
    assert list(content) == ["network_fn_state_dict", "network_fine_state_dict"]
    assert all(type(state) is dict and set(map(type, state.values())) == {torch.Tensor} for state in content.values())
    assert (tmp_path / "a.tar").read_bytes() == (tmp_path / "b.tar").read_bytes()


def assert_rejected(path, words):
    with little_memory(), pytest.raises(DataError) as caught:
        read_bmild(path)
    assert str(path) in caught.value.sentence and words in caught.value.sentence and caught.value.hint


def test_pickled_code_is_rejected_and_not_run(tmp_path, model):
    trap = Trap(tmp_path / "sprung")
    write_arrays(model, [*ARRAYS[:-1], trap])
    assert_rejected(model, "mkdir, which is not an array")
    assert not trap.folder.exists()


def cut(kept):
    def write(path):
        write_arrays(path, ARRAYS)
        path.write_bytes(path.read_bytes()[:kept])

    return write


def stored(values):
    return lambda path: write_arrays(path, values)


def pickled(content):
    def write(path):
        with path.open("wb") as file:
            np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": (1,)})
            file.write(content)

    return write


def one_array_many_times():
    entries = np.empty(3000, object)
    entries[:] = [np.zeros(100_000, np.float32)] * 3000
    return pickle.dumps(entries, 2)


@pytest.mark.parametrize(
    ("write", "words"),
    [
        *((cut(kept), "cannot be read") for kept in (0, 5, 100, -60)),
        (stored([np.ones(2)] * 5), "holds 5 arrays"),
        (stored([np.array(["a", "b"])] * 24), "cannot be read"),
        (stored(ARRAYS[2:]), "a network of another kind"),  # without the first layer
        (stored([*ARRAYS[:-1], np.full_like(ARRAYS[-1], np.nan)]), "not finite"),
        (lambda path: None, "does not exist"),
        (lambda path: np.save(path, np.ones(5)), "one array of numbers"),
        (lambda path: path.symlink_to("/dev/zero"), "is a pipe or a device, not a file"),
        (pickled(b"K\x01r" + struct.pack("<I", 2**28) + b"."), "numbers an entry 268435456"),
        (pickled(b"\x8e" + struct.pack("<Q", 2**40) + b"x."), "cannot be read"),  # a long text
        (pickled(one_array_many_times()), "repeat a few numbers"),
    ],
)
def test_malformed_networks_are_rejected_in_little_memory(model, write, words):
    write(model)
    assert_rejected(model, words)


@pytest.mark.parametrize(
    ("out", "code", "words"),
    [("out.tar", DataError.exit_code, f"{FILES[0]} cannot be read"), (FILES[0], 2, "does not end in .tar")],
)
def test_failed_conversion_keeps_existing_files(tmp_path, model, capsys, out, code, words):
    (tmp_path / "out.tar").write_bytes(b"kept")
    model.write_bytes(b"kept")
    assert main([str(model), str(tmp_path / out)]) == code
    assert words in capsys.readouterr().err
    assert (tmp_path / out).read_bytes() == b"kept"
