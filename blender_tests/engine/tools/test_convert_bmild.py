"""Networks of bmild/nerf become a checkpoint of nerf-pytorch with the same numbers, and nothing in a file is ever run."""

import pickle
import struct

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.checkpoints import Trap, bmild_arrays, vanilla_state, write_arrays
from blender_tests.engine.reference.memory import little_memory
from karf_engine.errors import DataError
from karf_engine.fields.nerf.importing import read_nerf
from tools.convert_bmild import main, read_bmild

FILES = ("model_200000.npy", "model_fine_200000.npy")


def is_state(network, state):
    """Whether a network's tensors are these, bit by bit."""
    found = network.state_dict()
    return found.keys() == state.keys() and all(torch.equal(found[name], value) for name, value in state.items())


def converted(tmp_path, given):
    """The networks that the engine reads from what the command has made of a file."""
    out = tmp_path / "out" / "200000.tar"
    assert main([str(tmp_path / given), str(out)]) == 0
    return read_nerf(out)


# ---------------------------------------------------------------------------------------------------------- same numbers
@pytest.mark.parametrize("protocol", [None, 2])
@pytest.mark.parametrize("given", FILES)
def test_both_networks_arrive_bit_by_bit(tmp_path, given, protocol):
    states = vanilla_state(1), vanilla_state(2)
    for name, state in zip(FILES, states, strict=True):
        write_arrays(tmp_path / name, bmild_arrays(state), protocol)
    for network, state in zip(converted(tmp_path, given), states, strict=True):
        assert is_state(network, state)
        assert network.shape.skips == (5,) and not network.shape.linear_first and not network.shape.rectified_features


@pytest.mark.parametrize("name", FILES)
def test_one_file_alone_serves_twice(tmp_path, name):
    write_arrays(tmp_path / name, bmild_arrays(vanilla_state(1)))
    coarse, fine = converted(tmp_path, name)
    assert is_state(coarse, vanilla_state(1)) and is_state(fine, vanilla_state(1))


def test_the_type_and_the_order_of_the_numbers_in_the_file_do_not_matter(tmp_path):
    arrays = [np.asfortranarray(array.astype(">f8")) for array in bmild_arrays(vanilla_state(1))]
    write_arrays(tmp_path / FILES[0], arrays)
    assert is_state(converted(tmp_path, FILES[0])[0], vanilla_state(1))


def test_the_checkpoint_is_tensors_alone_and_the_same_each_time(tmp_path):
    write_arrays(tmp_path / FILES[0], bmild_arrays(vanilla_state(1)))
    for name in ("a.tar", "b.tar"):
        assert main([str(tmp_path / FILES[0]), str(tmp_path / name)]) == 0
    content = torch.load(tmp_path / "a.tar", weights_only=True)
    assert list(content) == ["network_fn_state_dict", "network_fine_state_dict"]
    assert all(type(state) is dict and set(map(type, state.values())) == {torch.Tensor} for state in content.values())
    assert (tmp_path / "a.tar").read_bytes() == (tmp_path / "b.tar").read_bytes()


# ------------------------------------------------------------------------------------------------------------ refusals
MODEL = "model_1.npy"
WHOLE = bmild_arrays(vanilla_state(1))


def refusal(path):
    with little_memory(), pytest.raises(DataError) as caught:
        read_bmild(path)
    assert str(path) in caught.value.sentence and caught.value.hint
    return caught.value.sentence


def test_a_list_of_arrays_that_would_run_code_is_refused_and_runs_nothing(tmp_path):
    trap = Trap(tmp_path / "sprung")
    write_arrays(tmp_path / MODEL, [*WHOLE[:-1], trap])
    assert "mkdir, which is not an array" in refusal(tmp_path / MODEL)
    assert not trap.folder.exists()


@pytest.mark.parametrize("kept", [0, 5, 100, -60])
def test_a_truncated_file_is_refused(tmp_path, kept):
    write_arrays(tmp_path / MODEL, WHOLE)
    (tmp_path / MODEL).write_bytes((tmp_path / MODEL).read_bytes()[:kept])
    assert "cannot be read" in refusal(tmp_path / MODEL)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ([np.ones(2)] * 5, "holds 5 arrays"),
        ([np.array(["a", "b"])] * 24, "cannot be read"),
        (WHOLE[2:], "a network of another kind"),  # without the first layer
        ([*WHOLE[:-1], np.full_like(WHOLE[-1], np.nan)], "not finite"),
    ],
)
def test_arrays_of_no_nerf_are_refused(tmp_path, arrays, words):
    write_arrays(tmp_path / MODEL, arrays)
    assert words in refusal(tmp_path / MODEL)


def test_what_is_no_list_of_arrays_is_refused(tmp_path):
    assert "does not exist" in refusal(tmp_path / MODEL)
    np.save(tmp_path / MODEL, np.ones(5))
    assert "one array of numbers" in refusal(tmp_path / MODEL)
    (tmp_path / "model_2.npy").symlink_to("/dev/zero")
    assert "is a pipe or a device, not a file" in refusal(tmp_path / "model_2.npy")


def one_array_many_times():
    entries = np.empty(3000, object)
    entries[:] = [np.zeros(100_000, np.float32)] * 3000
    return pickle.dumps(entries, 2)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"K\x01r" + struct.pack("<I", 2**28) + b".", "numbers an entry 268435456"),
        (b"\x8e" + struct.pack("<Q", 2**40) + b"x.", "cannot be read"),  # a long text
        (one_array_many_times(), "repeat a few numbers"),
    ],
)
def test_claims_beyond_the_file_are_refused_without_taking_memory(tmp_path, content, words):
    with (tmp_path / MODEL).open("wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": (1,)})
        file.write(content)
    assert words in refusal(tmp_path / MODEL)


# ------------------------------------------------------------------------------------------------------------- command
def test_the_command_says_what_is_wrong_and_leaves_what_was_there(tmp_path, capsys):
    out = tmp_path / "out.tar"
    out.write_bytes(b"kept")
    (tmp_path / MODEL).write_bytes(b"no arrays")
    assert main([str(tmp_path / MODEL), str(out)]) == DataError.exit_code
    said = capsys.readouterr().err
    assert said.startswith(f"error: {tmp_path / MODEL} cannot be read") and "bmild/nerf" in said
    assert out.read_bytes() == b"kept"


def test_the_command_never_writes_over_a_list_of_arrays(tmp_path, capsys):
    write_arrays(tmp_path / MODEL, WHOLE)
    before = (tmp_path / MODEL).read_bytes()
    assert main([str(tmp_path / MODEL)] * 2) == 2
    assert "does not end in .tar" in capsys.readouterr().err
    assert (tmp_path / MODEL).read_bytes() == before
