"""Checkpoints of other programs: the same numbers come out, and nothing in a file is ever run."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.checkpoints import (
    N_DIRECTION,
    N_POSITION,
    OCTAVES,
    Trap,
    layers,
    vanilla_state,
    write_arrays,
)
from blender_tests.engine.reference.nerf import flexible, vanilla
from karf_engine.errors import DataError
from karf_engine.fields.nerf.files import read_nerf

POINT, DIRECTION = np.array([0.3, -0.7, 0.2]), np.array([0.6, 0.0, -0.8])


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


# ------------------------------------------------------------------------------------------------------------ refusals
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


@pytest.mark.parametrize("kept", [0, 5, 100, -60])
def test_a_truncated_file_is_refused(tmp_path, kept):
    torch.save({"network_fn_state_dict": vanilla_state(1)}, tmp_path / "a.tar")
    (tmp_path / "a.tar").write_bytes((tmp_path / "a.tar").read_bytes()[:kept])
    assert "cannot be read" in refusal(tmp_path / "a.tar")


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


def test_what_bmild_has_written_is_refused_with_the_command_that_converts_it(tmp_path):
    trap = Trap(tmp_path / "sprung")
    write_arrays(tmp_path / "model_1.npy", [trap])
    assert "as bmild/nerf writes" in refusal(tmp_path / "model_1.npy")
    with pytest.raises(DataError, match=r"python -m tools\.convert_bmild MODEL\.npy OUT\.tar"):
        read_nerf(tmp_path / "model_1.npy")
    assert not trap.folder.exists()


def test_weights_that_are_not_finite_are_refused(tmp_path):
    state = vanilla_state(1)
    state["rgb_linear.bias"][1] = float("nan")
    torch.save({"network_fn_state_dict": state}, tmp_path / "a.tar")
    assert "not finite" in refusal(tmp_path / "a.tar")
