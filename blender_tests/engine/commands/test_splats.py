"""The stage splats: learned once, skipped where none are wanted, and resumed."""

import itertools
from unittest.mock import Mock

import pytest

pytest.importorskip("numba")

import karf_engine as karf
from blender_tests.engine.commands.conftest import Events
from blender_tests.engine.conftest import QUICK, finish_again
from karf_engine.commands import splats
from karf_engine.commands.options import SplatsOptions
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.fields.scene_surface import NoSurface
from karf_engine.project import Project
from karf_engine.project.state import without_stage, write_state
from karf_engine.splats import details
from karf_engine.splats.files import load_gaussians
from karf_engine.splats.gaussians import Gaussians
from karf_engine.worker.protocol import STAGES

FEW = ("splats.iterations=12", "splats.count=1000", "splats.long_side=32", "splats.degree=0")


@pytest.fixture
def bare(copy):
    """A copied project without splats."""
    copy.splats_file.unlink()
    write_state(copy.state_file, without_stage(copy.state(), "splats"))
    return copy


@pytest.fixture
def brief(monkeypatch):
    """Details learned in moments."""
    for name in details.QUALITIES:
        monkeypatch.setitem(details.QUALITIES, name, details.Quality(64, 300, 40_000))


def learn(project, *overrides, should_stop=lambda: False, threads=1, quality="draft"):
    """Run the stage; returns its events."""
    events = Events()
    options = SplatsOptions(project=project.folder, overrides=overrides, threads=threads, device="cpu", quality=quality)
    splats.run(options, events, should_stop)
    return events


def test_stage_summary_lists_files_and_held_out_quality(learned):
    project = Project(learned.project)
    done = project.finished("splats")
    assert done["files"].keys() == {"splats.safetensors"} and done["seconds"] > 0
    assert done["gaussians"] == len(load_gaussians(project.splats_file))
    (mean_before, worst_before, *_), (mean, worst, mean_exposed, worst_exposed) = done["held_out"]
    assert mean > mean_before > 15 and worst <= mean and worst_before <= mean_before
    assert worst_exposed <= mean_exposed and abs(mean_exposed - mean) < 1, "all photos have the same exposure"
    assert "splats: held-out views" in learned.output and "splats" in STAGES


def test_rerun_is_skipped_and_repairs_damage_byte_identically(bare):
    learn(bare, *FEW)
    before = bare.splats_file.read_bytes()
    assert learn(bare).is_done_already("splats")  # the settings are kept
    bare.splats_file.write_bytes(before[:-4] + b"\0\0\1\0")
    assert not bare.is_intact("splats")
    learn(bare, threads=2)
    assert bare.splats_file.read_bytes() == before
    learn(bare, "splats.iterations=14")
    assert bare.splats_file.read_bytes() != before


def test_splats_need_geometry_but_no_masks(bare, tmp_path):
    finish_again(bare.folder, "geometry")
    assert bare.finished("segmentation") is None
    learn(bare, *FEW)
    model = karf.load(bare.folder, "cpu")
    frame = model.render(model.working_camera(model.capture.views[0]))
    assert isinstance(model.splats, Gaussians) and frame.probabilities.shape[0] == 0
    assert frame.palette_weights is None and frame.color.max() > 0.3
    with pytest.raises(DataError, match="is not a KaRF project"):
        learn(Project(tmp_path / "nothing"))
    with pytest.raises(BadRequest, match="Only settings of splats"):
        learn(bare, "geometry.long_side=64")


def test_zero_iterations_learn_no_splats(bare):
    assert learn(bare, "splats.iterations=0").values("stage", "text") == ["none are asked for"]
    assert bare.finished("splats") is None and not bare.splats_file.exists()


@pytest.mark.parametrize("reason", ["numba", "nothing solid"])
def test_unlearnable_splats_give_a_warning_and_leave_the_field(bare, monkeypatch, reason):
    if reason == "numba":
        monkeypatch.setenv("KARF_KERNELS", "off")
    else:
        fog = NoSurface("The learned scene shows nothing solid.", "Learn it again, with other settings.")
        monkeypatch.setattr("karf_engine.commands.splats.initial_gaussians", Mock(side_effect=fog))
    events = learn(bare, *FEW)
    assert events.values("warning", "code") == ["splats"] and reason in events.values("warning", "sentence")[0]
    assert bare.finished("splats") is None and karf.load(bare.folder, "cpu").splats is None


@pytest.mark.parametrize(("kernels", "warnings"), [("off", ["numba"]), ("on", [])])
def test_missing_numba_is_told_before_learning_begins(still_life, tmp_path, events, monkeypatch, kernels, warnings):
    monkeypatch.setenv("KARF_KERNELS", kernels)
    run = {"device": "cpu", "threads": 1, "emit": events, "should_stop": lambda: True}
    with pytest.raises(Cancelled):
        karf.learn_geometry(still_life.capture, project=tmp_path / "project", overrides=QUICK, **run)
    assert events.values("warning", "code") == warnings


def test_cancelled_stage_leaves_the_project_unchanged_and_resumes(bare):
    learn(bare, *FEW)
    whole = bare.splats_file.read_bytes()
    finish_again(bare.folder, "geometry")
    before = bare.state()
    for place, count in (("the surface", 3), ("a photo", 24)):
        asked = iter(range(count))
        with pytest.raises(Cancelled):
            learn(bare, should_stop=lambda asked=asked: next(asked, None) is None)
        assert bare.state() == before and not bare.splats_file.exists(), place
    assert any((text or "").startswith("resuming") for text in learn(bare).values("stage", "text"))
    assert bare.splats_file.read_bytes() == whole


def test_good_splats_add_gaussians_to_the_objects_and_the_draft_comes_back(copy, brief):
    draft, before = copy.splats_file.read_bytes(), copy.finished("splats")
    learn(copy, quality="good")
    done, learned = copy.finished("splats"), load_gaussians(copy.splats_file)
    assert done["quality"] == "good" and len(learned) == done["gaussians"] == before["gaussians"] + 300
    assert learned.visibility is not None and done["reached"][0] in ("sharp", "soft", "poor")
    assert learn(copy, quality="good").is_done_already("splats")
    learn(copy, quality="best")
    assert copy.finished("splats")["quality"] == "best" and copy.draft_file.read_bytes() == draft
    learn(copy)
    assert copy.splats_file.read_bytes() == draft and copy.finished("splats")["fingerprint"] == before["fingerprint"]
    assert learn(copy).is_done_already("splats")


def test_good_splats_learn_a_draft_first_where_there_is_none_and_need_objects(bare, brief):
    learn(bare, *FEW, quality="good")
    assert bare.finished("splats")["quality"] == "good" and bare.draft_file.exists()
    finish_again(bare.folder, "geometry")
    with pytest.raises(BadRequest, match="Run the segmentation stage first"):
        learn(bare, quality="good")


def test_damaged_details_are_learned_again_to_the_bit(copy, brief):
    learn(copy, quality="good")
    before = copy.splats_file.read_bytes()
    copy.splats_file.write_bytes(before[:-4] + b"\0\0\1\0")
    learn(copy, quality="good")
    assert copy.splats_file.read_bytes() == before and copy.is_intact("splats")


def test_interrupted_details_resume_to_the_bit(copy, brief):
    asked = itertools.count()
    with pytest.raises(Cancelled):
        learn(copy, quality="good", should_stop=lambda: next(asked) > 7)
    assert copy.finished("splats").get("quality") != "good"
    events = learn(copy, quality="good")
    assert any("resuming at iteration" in text for text in events.values("stage", "text") if text)
    resumed = copy.splats_file.read_bytes()
    learn(copy)
    learn(copy, quality="good", threads=2)
    assert copy.splats_file.read_bytes() == resumed
