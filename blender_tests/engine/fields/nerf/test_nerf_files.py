"""Checkpoints of other programs: the same numbers come out, and nothing in a file is ever run."""

import os
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.nerf import flexible, vanilla
from karf_engine.errors import DataError
from karf_engine.fields.nerf.files import read_nerf

OCTAVES = (4, 2)
N_POSITION, N_DIRECTION = 27, 15
POINT, DIRECTION = np.array([0.3, -0.7, 0.2]), np.array([0.6, 0.0, -0.8])


def layers(sizes, seed):
    """Weights and biases of layers {name: (in, out)}."""
    random = torch.Generator().manual_seed(seed)
    state = {}
    for name, (n_in, n_out) in sizes.items():
        state[f"{name}.weight"] = torch.randn(n_out, n_in, generator=random) / n_in**0.5
        state[f"{name}.bias"] = torch.randn(n_out, generator=random) / 4
    return state


def vanilla_state(seed, width=12):
    sizes = {f"pts_linears.{n}": (width, width) for n in range(8)}
    sizes |= {"pts_linears.0": (N_POSITION, width), "pts_linears.5": (N_POSITION + width, width)}
    sizes |= {"views_linears.0": (width + N_DIRECTION, width // 2), "feature_linear": (width, width)}
    return layers(sizes | {"alpha_linear": (width, 1), "rgb_linear": (width // 2, 3)}, seed)


def flexible_state(seed, n_layers, skip_every=4, width=12):
    sizes = {"layer1": (N_POSITION, width)}
    for n in range(n_layers - 1):
        joins = n % skip_every == 0 and 0 < n < n_layers - 1
        sizes[f"layers_xyz.{n}"] = (width + N_POSITION * joins, width)
    sizes |= {"fc_feat": (width, width), "fc_alpha": (width, 1), "fc_rgb": (width // 2, 3)}
    return layers(sizes | {"layers_dir.0": (width + N_DIRECTION, width // 2)}, seed)


def plain(state):
    return {name: value.double().numpy() for name, value in state.items()}


def outputs(network):
    """Raw density, features and color of a network at the point."""
    hidden = network.hidden(torch.from_numpy(POINT).float()[None])
    features = network.features(hidden)
    color = network.color(features, torch.from_numpy(DIRECTION).float()[None])
    return network.raw_density(hidden)[0].item(), features[0].detach(), color[0].detach()


def agree(network, expected):
    for got, wanted in zip(outputs(network), expected, strict=True):
        assert_allclose(got, wanted, atol=1e-5)


def refusal(path):
    with pytest.raises(DataError) as caught:
        read_nerf(path)
    assert str(path) in caught.value.sentence and caught.value.hint
    return caught.value.sentence


# -------------------------------------------------------------------------------------------------------- nerf-pytorch
@pytest.mark.parametrize("zipped", [True, False])
@pytest.mark.parametrize("prefix", ["", "module."])
def test_a_nerf_pytorch_checkpoint_computes_what_that_program_does(tmp_path, zipped, prefix):
    states = vanilla_state(1), vanilla_state(2)
    optimizer = torch.optim.Adam([torch.nn.Parameter(torch.ones(3))])
    content = {"global_step": 200_000, "optimizer_state_dict": optimizer.state_dict()}
    for name, state in zip(("network_fn_state_dict", "network_fine_state_dict"), states, strict=True):
        content[name] = {prefix + key: value for key, value in state.items()}
    torch.save(content, tmp_path / "200000.tar", _use_new_zipfile_serialization=zipped)
    for network, state in zip(read_nerf(tmp_path / "200000.tar"), states, strict=True):
        assert network.shape.skips == (5,) and not network.shape.linear_first
        agree(network, vanilla(plain(state), POINT, DIRECTION, OCTAVES))


def test_without_a_fine_network_the_coarse_one_serves_twice(tmp_path):
    content = {"network_fn_state_dict": vanilla_state(1), "network_fine_state_dict": None}
    torch.save(content, tmp_path / "a.tar")
    coarse, fine = read_nerf(tmp_path / "a.tar")
    assert coarse is not fine
    agree(fine, outputs(coarse))


# ----------------------------------------------------------------------------------------------------------- krrish94
@pytest.mark.parametrize("n_layers", [4, 8])
def test_a_krrish94_checkpoint_computes_what_that_program_does(tmp_path, n_layers):
    states = flexible_state(1, n_layers), flexible_state(2, n_layers)
    content = {"iter": 5, "model_coarse_state_dict": states[0], "model_fine_state_dict": states[1]}
    content |= {"loss": torch.tensor(0.1), "psnr": np.float64(25.0)}  # as its training script notes them
    torch.save(content, tmp_path / "checkpoint5.ckpt")
    for network, state in zip(read_nerf(tmp_path / "checkpoint5.ckpt"), states, strict=True):
        agree(network, flexible(plain(state), POINT, DIRECTION, OCTAVES, n_layers, 4))


# -------------------------------------------------------------------------------------------------------------- bmild
def keras_list(state):
    names = [f"pts_linears.{n}" for n in range(8)] + ["feature_linear", "views_linears.0", "rgb_linear", "alpha_linear"]
    arrays = []
    for name in names:
        arrays += [state[f"{name}.weight"].numpy().T.copy(), state[f"{name}.bias"].numpy()]
    return arrays


def write_list(path, arrays, protocol=None):
    """As np.save does with a list of arrays of different shapes."""
    stacked = np.empty(len(arrays), object)
    stacked[:] = arrays
    if protocol is None:
        np.save(path, stacked, allow_pickle=True)
        return
    with path.open("wb") as file:  # as numpy before 1.17, under its old module names
        np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": stacked.shape})
        file.write(pickle.dumps(stacked, protocol).replace(b"numpy._core.multiarray", b"numpy.core.multiarray"))


@pytest.mark.parametrize("protocol", [None, 2])
@pytest.mark.parametrize("given", ["model_200000.npy", "model_fine_200000.npy"])
def test_bmild_weight_lists_compute_what_that_program_does(tmp_path, given, protocol):
    states = vanilla_state(1), vanilla_state(2)
    for name, state in zip(("model_200000.npy", "model_fine_200000.npy"), states, strict=True):
        write_list(tmp_path / name, keras_list(state), protocol)
    for network, state in zip(read_nerf(tmp_path / given), states, strict=True):
        agree(network, vanilla(plain(state), POINT, DIRECTION, OCTAVES))


def test_a_bmild_list_without_its_fine_one_serves_twice(tmp_path):
    write_list(tmp_path / "model_1.npy", keras_list(vanilla_state(1)))
    coarse, fine = read_nerf(tmp_path / "model_1.npy")
    agree(fine, outputs(coarse))


# ------------------------------------------------------------------------------------------------------------ refusals
class Trap:
    """Makes a folder when it is unpickled."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (str(self.folder),)


def test_a_checkpoint_that_would_run_code_is_refused_and_runs_nothing(tmp_path):
    trap = Trap(tmp_path / "sprung")
    for name, zipped in (("a.tar", True), ("b.ckpt", False)):
        content = {"network_fn_state_dict": vanilla_state(1), "evil": trap}
        torch.save(content, tmp_path / name, _use_new_zipfile_serialization=zipped)
        assert "cannot be read as a checkpoint of numbers alone" in refusal(tmp_path / name)
    (tmp_path / "c.tar").write_bytes(pickle.dumps(trap, 2))
    refusal(tmp_path / "c.tar")
    assert not trap.folder.exists()
    pickle.loads(pickle.dumps(trap))  # the trap does work
    assert trap.folder.exists()


def test_a_list_of_arrays_that_would_run_code_is_refused_and_runs_nothing(tmp_path):
    trap = Trap(tmp_path / "sprung")
    write_list(tmp_path / "model_1.npy", [*keras_list(vanilla_state(1))[:-1], trap])
    assert "mkdir, which is no array" in refusal(tmp_path / "model_1.npy")
    assert not trap.folder.exists()


@pytest.mark.parametrize("kept", [0, 5, 100, -60])
@pytest.mark.parametrize("name", ["a.tar", "model_1.npy"])
def test_a_truncated_file_is_refused(tmp_path, name, kept):
    torch.save({"network_fn_state_dict": vanilla_state(1)}, tmp_path / "a.tar")
    write_list(tmp_path / "model_1.npy", keras_list(vanilla_state(1)))
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:kept])
    assert "cannot be read" in refusal(tmp_path / name)


def test_what_is_no_nerf_is_refused_by_name(tmp_path):
    assert "does not exist" in refusal(tmp_path / "nothing.tar")
    torch.save({"weights": torch.ones(3)}, tmp_path / "a.tar")
    assert "no networks under a name known here" in refusal(tmp_path / "a.tar")
    blind = {name: value for name, value in vanilla_state(1).items() if "views" not in name}
    torch.save({"network_fn_state_dict": blind}, tmp_path / "b.tar")
    assert "views_linears.0.weight" in refusal(tmp_path / "b.tar")
    deeper = vanilla_state(1) | layers({"views_linears.1": (6, 6)}, 0)
    torch.save({"network_fn_state_dict": deeper}, tmp_path / "c.tar")
    assert "a network of another kind" in refusal(tmp_path / "c.tar")
    np.save(tmp_path / "model_1.npy", np.ones(5))
    assert "one array of numbers" in refusal(tmp_path / "model_1.npy")
    write_list(tmp_path / "model_2.npy", [np.ones(2)] * 5)
    assert "holds 5 arrays" in refusal(tmp_path / "model_2.npy")
    write_list(tmp_path / "model_3.npy", [np.array(["a", "b"])] * 24)
    assert "cannot be read" in refusal(tmp_path / "model_3.npy")


def test_weights_that_are_not_finite_are_refused(tmp_path):
    state = vanilla_state(1)
    state["rgb_linear.bias"][1] = float("nan")
    torch.save({"network_fn_state_dict": state}, tmp_path / "a.tar")
    assert "not finite" in refusal(tmp_path / "a.tar")
