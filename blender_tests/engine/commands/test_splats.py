"""The stage splats: learned once, outdated by the field it stands on and by nothing else, left out where none are wanted."""

import shutil

import imageio.v3 as iio
import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")
pytest.importorskip("numba")

import karf_engine as karf
from blender_tests.engine.commands.farm.sequences import write_sequence
from blender_tests.engine.conftest import finish_again
from karf_engine.commands import splats
from karf_engine.commands.options import SplatsOptions
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.fields.scene_surface import NoSurface
from karf_engine.project import Project
from karf_engine.project.settings import PRESETS
from karf_engine.project.state import write_state
from karf_engine.splats.files import load_gaussians
from karf_engine.splats.gaussians import Gaussians
from karf_engine.worker.protocol import STAGES

FEW = ("splats.iterations=12", "splats.count=1000", "splats.long_side=32", "splats.degree=0")


@pytest.fixture
def copy(learned, tmp_path):
    """A project of one's own, without splats."""
    project = Project(shutil.copytree(learned.project, tmp_path / "project"))
    project.finish("recoloring", "kept", **without_fingerprint(project.finished("recoloring")))
    project.splats_file.unlink()
    state = project.state()
    del state["stages"]["splats"]
    write_state(project.state_file, state)
    return project


def without_fingerprint(summary):
    return {name: value for name, value in summary.items() if name != "fingerprint"}


def learn(project, *overrides, should_stop=lambda: False):
    """Run the stage; its events."""
    events = []
    options = SplatsOptions(project=project.folder, overrides=overrides, threads=1, device="cpu")
    splats.run(options, lambda kind, /, **values: events.append((kind, values)), should_stop)
    return events


def texts(events):
    return [values.get("text") for kind, values in events if kind == "stage"]


def test_the_stage_is_noted_with_what_it_learned_and_how_well(learned):
    project = Project(learned.project)
    done = project.finished("splats")
    assert done["files"].keys() == {"splats.safetensors"} and done["seconds"] > 0
    assert done["gaussians"] == len(load_gaussians(project.splats_file))
    (mean_before, worst_before, *_), (mean, worst, mean_exposed, worst_exposed) = done["held_out"]
    assert mean > mean_before > 15 and worst <= mean and worst_before <= mean_before
    assert worst_exposed <= mean_exposed and abs(mean_exposed - mean) < 1, "photos that are exposed alike"
    assert "splats: held-out views" in learned.output and "splats" in STAGES


def test_it_is_done_once(copy):
    learn(copy, *FEW)
    before = copy.splats_file.read_bytes()
    assert texts(learn(copy)) == ["already done"]  # the settings are kept
    assert copy.splats_file.read_bytes() == before
    learn(copy, "splats.iterations=14")
    assert copy.splats_file.read_bytes() != before


def test_the_same_again_gives_the_same_bytes_on_any_number_of_cores(copy):
    learn(copy, *FEW)
    before = copy.splats_file.read_bytes()
    copy.splats_file.unlink()
    karf.learn_splats(copy.folder, threads=2, device="cpu")
    assert copy.splats_file.read_bytes() == before


def test_damage_is_noticed_and_mended(copy):
    learn(copy, *FEW)
    before = copy.splats_file.read_bytes()
    copy.splats_file.write_bytes(before[:-4] + b"\0\0\1\0")
    assert not copy.is_intact("splats")
    learn(copy)
    assert copy.splats_file.read_bytes() == before


def test_another_field_makes_them_outdated_and_other_masks_do_not(copy):
    learn(copy, *FEW)
    for stage, left in (("recoloring", True), ("segmentation", True), ("geometry", False)):
        finish_again(copy.folder, stage)
        assert (copy.finished("splats") is not None) == left
    learn(copy, *FEW)
    assert copy.finished("splats") is not None


def test_they_need_a_field_and_no_masks(copy, tmp_path):
    copy.finish("geometry", "kept", **without_fingerprint(copy.finished("geometry")))
    assert copy.finished("segmentation") is None
    learn(copy, *FEW)
    model = karf.load(copy.folder, "cpu")
    frame = model.render(model.working_camera(model.capture.views[0]))
    assert isinstance(model.splats, Gaussians) and frame.probabilities.shape[0] == 0
    assert frame.palette_weights is None and frame.color.max() > 0.3
    with pytest.raises(DataError, match="is not a KaRF project"):
        learn(Project(tmp_path / "nothing"))


def test_none_are_learned_where_none_are_asked_for(copy):
    assert texts(learn(copy, "splats.iterations=0")) == ["none are asked for"]
    assert copy.finished("splats") is None and not copy.splats_file.exists()
    assert karf.load(copy.folder, "cpu").splats is None


def test_the_papers_preset_has_none():
    assert PRESETS["paper"].splats.iterations == 0
    assert all(PRESETS[name].splats.iterations > 0 for name in PRESETS if name != "paper")


def test_without_numba_there_is_a_warning_and_the_field_is_shown(copy, monkeypatch):
    monkeypatch.setenv("KARF_KERNELS", "off")
    events = learn(copy, *FEW)
    assert [values["code"] for kind, values in events if kind == "warning"] == ["splats"]
    assert "numba" in events[-1][1]["sentence"] and copy.finished("splats") is None


def test_fog_gives_a_warning_and_the_field_is_shown(copy, monkeypatch):
    def fog(*_):
        raise NoSurface("The learned scene shows nothing solid.", "Learn it again, with other settings.")

    monkeypatch.setattr("karf_engine.commands.splats.initial_gaussians", fog)
    events = learn(copy, *FEW)
    assert [values["code"] for kind, values in events if kind == "warning"] == ["splats"]
    assert copy.finished("splats") is None and karf.load(copy.folder, "cpu").splats is None


@pytest.mark.parametrize("override", ["geometry.long_side=64", "seed=3", "render.source=field", "splats.iteration=3"])
def test_settings_of_other_stages_are_refused(copy, override):
    before = copy.state()
    with pytest.raises(BadRequest) as caught:
        learn(copy, override)
    assert caught.value.hint and copy.state() == before


@pytest.mark.parametrize("at", ["the surface", "a photo"])
def test_a_cancelled_stage_leaves_the_project_as_it_was_and_resumes(copy, at):
    learn(copy, *FEW)
    whole = copy.splats_file.read_bytes()
    copy.finish("geometry", "kept", **without_fingerprint(copy.finished("geometry")))
    before, asked = copy.state(), []

    def should_stop():
        asked.append(1)
        return len(asked) > {"the surface": 3, "a photo": 24}[at]

    with pytest.raises(Cancelled):
        learn(copy, should_stop=should_stop)
    assert copy.state() == before and not copy.splats_file.exists()
    said = [text for text in texts(learn(copy)) if text and text.startswith("resuming")]
    assert len(said) == (at == "a photo")
    assert copy.splats_file.read_bytes() == whole


def test_a_bundle_renders_the_frames_that_the_project_does(learned, tmp_path):
    sequence = write_sequence(learned.project, tmp_path, 2)
    bundle = karf.render_bundle(learned.project, tmp_path / "bundle", views=str(sequence.cameras), edit=sequence.edit)
    assert Project(bundle / "project").splats_file.is_file()
    for project, out in ((learned.project, "here"), (bundle / "project", "there")):
        karf.render(project, tmp_path / out, views=str(sequence.cameras), edit=sequence.edit, threads=1, device="cpu")
    here = {path.name: path.read_bytes() for path in (tmp_path / "here" / "recolor").iterdir()}
    assert here == {path.name: path.read_bytes() for path in (tmp_path / "there" / "recolor").iterdir()}
    assert len(here) == 2


def test_frames_of_other_splats_are_not_taken_for_finished(learned, tmp_path):
    project = Project(shutil.copytree(learned.project, tmp_path / "project"))
    sequence = write_sequence(project.folder, tmp_path, 1)

    def frame():
        options = {"views": str(sequence.cameras), "skip_existing": True, "threads": 1, "device": "cpu"}
        karf.render(project.folder, tmp_path / "out", **options)
        return iio.imread(next((tmp_path / "out" / "render").iterdir()))

    before = frame()
    assert np.array_equal(frame(), before)
    learn(project, "splats.iterations=0")  # asks for none, but keeps what is there
    learn(project, "splats.count=1000", "splats.iterations=5")
    assert not np.array_equal(frame(), before)
