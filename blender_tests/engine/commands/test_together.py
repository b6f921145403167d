"""One scene learned by two processes of torchrun on the CPU, with gloo."""

import os
from contextlib import suppress

import pytest
import torch

from blender_tests.engine.conftest import run_engine
from karf_engine.commands import geometry
from karf_engine.commands.options import GeometryOptions
from karf_engine.compute import runtime as runtime_module
from karf_engine.compute.runtime import ProcessGroup
from karf_engine.errors import BadRequest, Cancelled
from karf_engine.fields import training
from karf_engine.io.checkpoints import load_tensors
from karf_engine.project import Project

# more samples than 1024 rays take, so each share is of 512 rays; low rates, so that rounding errors do not grow
SETTINGS = tuple(
    """
    geometry.long_side=32 geometry.samples=200000 geometry.max_rays=1024 geometry.features=6
    geometry.levels=[{"voxels":16,"iterations":60,"step":1.0},{"voxels":24,"iterations":30,"step":1.0}]
    geometry.table_rate=0.1 geometry.network_rate=0.003
    """.split()
)
TORCHRUN = ("-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2")
needs_gloo = pytest.mark.skipif(
    os.name == "nt" or not torch.distributed.is_available(), reason="torchrun is tested where its gloo is"
)


def gradients_in_turn(training_state, step, iteration, parts):
    """`_gradients` of both processes of a group, one after the other in this one."""
    generator = training_state.generator
    before = generator.get_state()
    for rank in range(2):
        generator.set_state(before)
        with ProcessGroup(rank, 2).rank_random(generator):
            loss, metrics = step(iteration, 1 / (2 * parts))
            loss.backward()
    for group in training_state.optimizer.param_groups[:2]:
        for parameter in group["params"]:
            if parameter.grad is not None:
                parameter.grad /= 2
    return loss.detach(), metrics


def learn_in_turn(capture, project, until=1000):
    """Learn with `gradients_in_turn`, at most this many iterations."""
    done = []
    options = GeometryOptions(capture=capture, project=project, overrides=SETTINGS, threads=1)
    with pytest.MonkeyPatch.context() as patch, suppress(Cancelled):
        patch.setattr(training, "_gradients", lambda *given: (done.append(1), gradients_in_turn(*given))[1])
        geometry.run(options, lambda *_, **__: None, lambda: len(done) >= until)
    return Project(project).geometry_file


def learn_together(capture, project):
    """Learn in two processes; returns the ended torchrun."""
    settings = [part for text in SETTINGS for part in ("--set", text)]
    arguments = ("geometry", capture, "--project", project, "--threads", "1", *settings)
    return run_engine(*arguments, python=TORCHRUN)


@needs_gloo
@pytest.mark.parametrize(("kernels", "begun"), [("off", 0), ("on", 10)], ids=["from the start", "resumed with kernels"])
def test_two_processes_learn_what_one_does_in_turn(still_life, tmp_path, monkeypatch, kernels, begun):
    if kernels == "on":
        pytest.importorskip("numba")
    monkeypatch.setenv("KARF_KERNELS", kernels)
    expected, _ = load_tensors(learn_in_turn(still_life.capture, tmp_path / "in turn"), "karf-geometry/1")
    if begun:
        learn_in_turn(still_life.capture, tmp_path / "project", until=begun)
        assert not Project(tmp_path / "project").finished("geometry")
    done = learn_together(still_life.capture, tmp_path / "project")
    printed = done.stdout + done.stderr
    assert done.returncode == 0, printed
    assert ("resuming at iteration 10 of 90" in printed) == bool(begun)
    assert printed.count("held-out views") == 2  # of two levels, by one process
    found, _ = load_tensors(Project(tmp_path / "project").geometry_file, "karf-geometry/1")
    assert found.keys() == expected.keys()
    for name, tensor in expected.items():
        if kernels == "on" and tensor.is_floating_point():
            # kernels add the shares in another order, which Adam amplifies for tiny gradients
            differs = (found[name] - tensor).abs() > 1e-3 * (1 + tensor.abs())
            assert differs.float().mean() < 0.01, name
        else:
            torch.testing.assert_close(found[name], tensor)


@needs_gloo
def test_failing_process_ends_all(tmp_path):
    done = learn_together(tmp_path / "nothing", tmp_path / "project")
    assert done.returncode != 0 and (done.stdout + done.stderr).count("error: ") >= 1


def test_each_process_draws_its_own_numbers_from_a_common_state():
    drawn, after = [], []
    for rank in range(2):
        generator = torch.Generator().manual_seed(3)
        before = generator.get_state()
        with pytest.raises(MemoryError), ProcessGroup(rank, 2).rank_random(generator):
            torch.rand(3, generator=generator)
            raise MemoryError
        assert torch.equal(generator.get_state(), before)
        with ProcessGroup(rank, 2).rank_random(generator):
            drawn.append(torch.rand(10 + rank, generator=generator)[:10])
        after.append(torch.rand(10, generator=generator))
    assert not torch.equal(*drawn) and torch.equal(*after)


def test_different_grids_of_processes_are_rejected(monkeypatch):
    parameter = torch.nn.Parameter(torch.zeros(4))
    parameter.grad = torch.ones(4)
    monkeypatch.setattr(runtime_module.distributed, "all_reduce", lambda sizes, how: sizes.add_(1))
    with pytest.raises(BadRequest, match="come apart: 4 and 5 numbers"):
        ProcessGroup(0, 2).average([parameter])


def test_single_process_group_changes_nothing():
    alone, parameter = ProcessGroup(), torch.nn.Parameter(torch.zeros(2))
    parameter.grad = torch.tensor([1.0, 2.0])
    alone.average([parameter])
    assert alone.share("value") == "value" and parameter.grad.tolist() == [1.0, 2.0]
