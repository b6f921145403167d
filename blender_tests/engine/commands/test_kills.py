"""A stage that is cancelled, and run again: the same file as if nothing had happened; not so one that diverged."""

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

from blender_tests.engine.commands.conftest import geometry_command
from karf_engine.cli import main
from karf_engine.compute.progress import Progress
from karf_engine.errors import Cancelled, Diverged
from karf_engine.io.checkpoints import load_tensors
from karf_engine.project import Project
from karf_engine.project.state import without_stage, write_state

FEW = (
    'geometry.levels=[{"voxels": 16, "iterations": 60, "step": 1.0}, {"voxels": 20, "iterations": 60, "step": 1.0}]',
    "geometry.samples=4000",
    "geometry.max_rays=512",
)


def is_same_file(first, second):
    """Whether both hold the same tensors and facts."""
    schema = f"karf-{first.stem}/1"
    (a, facts), (b, other) = load_tensors(first, schema), load_tensors(second, schema)
    return facts == other and a.keys() == b.keys() and all(torch.equal(a[name], b[name]) for name in a)


@pytest.mark.parametrize("stage", ["segmentation", "recoloring"])
def test_a_cancelled_head_resumes_to_the_same_file(copy, learned, stage, monkeypatch, capsys):
    write_state(copy.state_file, without_stage(copy.state(), stage))
    count, steps = Progress.step, []

    def cancel(progress, number=1, **metrics):
        count(progress, number, **metrics)
        steps.extend([1] if "loss" in metrics or "palette" in metrics else [])
        if len(steps) > 25:
            raise Cancelled("The test wants it.")

    masks = ["--masks", str(copy.masks_folder)] if stage == "segmentation" else []
    command = [stage, str(copy.folder), *masks, "--threads", "1"]
    with monkeypatch.context() as patch:
        patch.setattr(Progress, "step", cancel)
        assert main(command) == Cancelled.exit_code
    assert copy.checkpoint_file(stage).exists()
    assert main(command) == 0
    assert "resuming at iteration 26 of" in capsys.readouterr().err
    assert is_same_file(*(each.output(f"{stage}.safetensors") for each in (Project(learned.project), copy)))
    assert not copy.checkpoint_file(stage).exists()


def test_what_led_to_divergence_is_not_resumed(still_life, tmp_path, monkeypatch):
    def find_nothing(fit):
        assert Project(tmp_path).checkpoint_file("geometry").exists()
        raise Diverged("Nothing is solid.")

    monkeypatch.setattr("karf_engine.fields.fit.CHECKPOINT_INTERVAL", 0.0)
    monkeypatch.setattr("karf_engine.fields.voxels.fit.VoxelFit._pruned", find_nothing)
    assert main(geometry_command(still_life, tmp_path, *FEW)) == Diverged.exit_code
    assert not Project(tmp_path).checkpoint_file("geometry").exists()
