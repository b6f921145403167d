"""All stages on a tiny still life: learned once by the command line, then rendered, edited and run again."""

import inspect
import json
from importlib import import_module
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import OpenEXR
import pytest
import torch
from scipy.ndimage import maximum_filter

import karf_engine
from blender_tests.engine.commands.conftest import assert_renders_well, cameras_file, run, stages_run
from blender_tests.engine.conftest import of_field
from blender_tests.engine.reference.still_life import camera_at, take_photo
from karf_engine.capture import open_capture
from karf_engine.commands.dispatch import run_command
from karf_engine.commands.options import COMMANDS, InspectOptions, LearnOptions, MarkOptions
from karf_engine.errors import BadRequest
from karf_engine.export.layer_names import read_layer_names
from karf_engine.export.scene_points import read_points
from karf_engine.io.color import linear_to_srgb
from karf_engine.io.images import read_mask, read_photo
from karf_engine.metrics.images import psnr
from karf_engine.palettes.compositing import planes_made_from, read_planes
from karf_engine.palettes.palette import read_edit, read_palettes, rgb_to_hex
from karf_engine.project import STAGE_ORDER, Project
from karf_engine.project.state import result_fingerprint
from karf_engine.project.volumes import Volume, write_volumes
from karf_engine.recolor.field_rendering import weights_of_field
from karf_engine.recolor.model import Model
from karf_engine.worker.protocol import STAGES, WARM


@pytest.fixture(scope="module")
def green(learned, tmp_path_factory):
    """An edit that turns the red ball green."""
    out = tmp_path_factory.mktemp("edit") / "green.json"
    assert run("match", learned.project, "--object", "ball", "--from", "#c0221a", "--to", "#1ec040", "--out", out) == 0
    return out


@pytest.fixture(scope="module")
def frames(learned, green, tmp_path_factory):
    """The held-out views rendered with every kind of output."""
    out = tmp_path_factory.mktemp("frames")
    options = ("--edit", green, "--depth", "--unsure", "--planes", "--out", out, "--threads", 1)
    assert run("render", learned.project, "--views", "test", *options) == 0
    return out


def contents(project):
    return {path.relative_to(project.folder): path.read_bytes() for path in project.folder.rglob("*") if path.is_file()}


def test_every_stage_stores_its_results(learned):
    project = Project(learned.project)
    assert all(project.finished(stage)["seconds"] > 0 for stage in STAGE_ORDER)
    assert project.finished("geometry")["background"] == "black"
    assert [palette.name for palette in read_palettes(project.palette_file)] == ["ball", "block"]
    report = json.loads(project.segmentation_report.read_text())
    assert report["objects"] == ["ball", "block"]
    assert all(score > 0.5 for scores in report["iou_with_marks"].values() for score in scores)
    masks = sorted(f"{path.parent.name}/{path.stem}" for path in project.masks_folder.rglob("*.png"))
    assert masks == ["ball/r_8", "ball/train_r_0", "block/r_8", "block/train_r_0"]  # there is an r_0 in both splits
    assert not (project.folder / "lock.json").exists()
    assert [line for line in learned.output.splitlines() if line in STAGE_ORDER] == list(STAGE_ORDER)


def test_rerun_runs_only_stages_of_changed_settings(still_life, copy, capsys):
    def times():  # except of the lock, which older releases of filelock touch
        return {name: (copy.folder / name).stat().st_mtime_ns for name in before.keys() - {Path("lock")}}

    before = contents(copy)
    times_before = times()
    assert run(*still_life.command(copy.folder)) == 0
    assert contents(copy) == before and times() == times_before and stages_run(capsys.readouterr().err) == []
    assert run(*still_life.command(copy.folder, "palette.colors=2", "recoloring.iterations=3")) == 0
    assert stages_run(capsys.readouterr().err) == ["palette", "recoloring"]
    changed = {name.name for name, content in contents(copy).items() if before.get(name) != content}
    assert changed == {"project.json", "palette.json", "object_colors.npz", "recoloring.safetensors"}
    assert {len(palette.colors) for palette in read_palettes(copy.palette_file)} == {2}


def test_zero_iterations_keep_the_extracted_palettes(copy, green, tmp_path, capsys):
    untrained = ("recoloring", copy.folder, "--threads", 1, "--set")
    assert run(*untrained, "recoloring.iterations=0") == 0
    assert copy.finished("recoloring")["files"].keys() == {"palette.json", "object_colors.npz"}
    extracted = read_palettes(copy.palette_file, "initial")
    model = karf_engine.load(copy.folder, "cpu")
    assert model.recoloring is None
    assert all(np.array_equal(own.colors, first.colors) for own, first in zip(model.palettes, extracted, strict=True))
    options = ("--edit", green, "--planes", "--set", "render.source=field", "--out", tmp_path / "frames")
    assert run("render", copy.folder, "--views", "test_r_0", *options, "--threads", 1) == 0
    assert f"karf recoloring {copy.folder} --set recoloring.iterations=" in capsys.readouterr().err
    assert run("points", copy.folder, "--out", tmp_path / "points.npz", "--count", 1000, "--threads", 1) == 0
    points = read_points(tmp_path / "points.npz")
    total = points.palette_weights.astype(float).sum(2)
    np.testing.assert_allclose(total, points.probabilities.astype(float), atol=2e-3)
    camera = model.working_camera(model.capture.views[0])
    frame = of_field(model).render(camera)
    np.testing.assert_allclose(frame.palette_weights.sum(1), frame.probabilities, atol=2e-3)
    with pytest.raises(BadRequest, match="karf recoloring"):
        weights_of_field(model, model.scene.render(camera, 3))
    assert run(*untrained, "recoloring.iterations=3") == 0
    assert karf_engine.load(copy.folder, "cpu").recoloring is not None
    assert run(*untrained, "palette.colors=3") == 2
    assert "Only settings of recoloring" in capsys.readouterr().err


def test_no_view_shows_an_object_beyond_its_volume(copy):
    half = np.diag([0.2, 2.0, 2.0, 1.0])
    half[0, 3] = 0.25  # x from 0.05 to 0.45; the block's is from 0.15 to 0.75
    write_volumes(copy.volumes_file, {"block": [Volume("inside", half)]})
    before = Model(copy)
    assert run("segmentation", copy.folder, "--threads", 1) == 0
    after = Model(copy)
    camera, block = before.working_camera(before.capture.views[0]), before.objects.index("block")
    covered = [model.render_field(camera).probabilities[block].sum() for model in (before, after)]
    assert 0.2 < covered[1] / covered[0] < 0.8
    beyond = after.scene.field.space.to_grid(torch.tensor([[0.6, 0.0, 0.0]]))
    assert not after.segmentation.inside(beyond)[0, block]


def test_held_out_views_match_color_masks_depth_and_uncertainty(still_life, frames):
    assert_renders_well(frames, still_life, 20, 0.6)
    for stem in ("r_0", "r_1"):
        truth = still_life.photos[f"test/{stem}"]
        for name in ("ball", "block"):
            unsure = read_photo(frames / "unsure" / name / f"test_{stem}.png")[..., 0]
            assert unsure.shape == (32, 32) and (unsure[:2, :2] == 0).all() and 0 < unsure.max() <= 1
        depth = np.load(frames / "depth" / f"test_{stem}.npy")
        assert depth.dtype == np.float32 and depth.shape == (32, 32)
        _, ball_depth = truth.camera.project(np.array([[-0.4, 0.0, 0.1]]))
        assert abs(np.median(depth[truth.labels == 1]) - (ball_depth[0] - 0.3)) < 0.25


def test_edit_turns_only_the_ball_green(still_life, frames):
    truth = still_life.photos["test/r_0"]
    recolored = read_photo(frames / "recolor" / "test_r_0.png")
    ball = recolored[(truth.labels == 1) & read_mask(frames / "masks" / "ball" / "test_r_0.png")].mean(0)
    assert ball[1] > 2 * ball[0]
    change = np.abs(recolored - np.rint(truth.color * 255) / 255).max(-1)
    outside = ~maximum_filter(truth.labels == 1, 3)
    assert change[outside].mean() < 0.02 < 0.2 < change[truth.labels == 1].mean()
    assert (change[truth.alpha == 0] == 0).mean() > 0.95


def test_planes_for_blender_hold_the_photo_and_weights(still_life, learned, frames):
    planes = read_planes(frames / "planes" / "test_r_0.npz")
    assert planes.objects == ("ball", "block")
    assert np.array_equal(planes.base, np.rint(still_life.photos["test/r_0"].color * 255))
    total = planes.palette_weights.sum(1, dtype=np.float32)
    np.testing.assert_allclose(total, planes.probabilities.astype(np.float32), atol=4e-3)
    project = Project(learned.project)
    in_project = project.planes_file("test_r_0")
    assert np.array_equal(read_planes(in_project).palette_weights, planes.palette_weights)
    assert planes_made_from(in_project) == result_fingerprint(project.state(), "recoloring")


def test_empty_edit_reproduces_photos_bit_by_bit(still_life, learned, tmp_path):
    (tmp_path / "same.json").write_text('{"schema": "karf-edit/1", "objects": {}}')
    options = ("--edit", tmp_path / "same.json", "--out", tmp_path, "--threads", 1)
    assert run("render", learned.project, "--views", "train_r_0,test_r_0,r_3", *options) == 0  # two are r_0 on disk
    written, capture = sorted((tmp_path / "recolor").iterdir()), open_capture(still_life.capture)
    assert [path.stem for path in written] == ["r_3", "test_r_0", "train_r_0"]
    for path in written:
        assert np.array_equal(read_photo(path), read_photo(capture.view(path.stem).image))


def recomposed(path, edit):
    """A compositor's result of layers and an edit, and the layers' depth."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        planes = {name: channel.pixels.astype(np.float32) for name, channel in file.channels().items()}
    result = linear_to_srgb(np.stack([planes[letter] for letter in "RGB"], -1))
    for each in read_layer_names(path):
        for name, change in zip(each.weights, edit.colors[each.name] - each.colors, strict=True):
            result += planes[f"{name}.V"][..., None] * change
    return np.clip(result, 0, 1), planes["Depth.Z"]


def test_free_cameras_are_rendered_recolored_and_layered(learned, green, tmp_path):
    cameras, truth = cameras_file(tmp_path / "path.json", 2, 24), take_photo(camera_at(1.0, 0.5, 24))
    options = ("--edit", green, "--planes", "--layers", "--layered", "--depth", "--out", tmp_path, "--threads", 1)
    assert run("render", learned.project, "--views", cameras, *options) == 0
    assert psnr(read_photo(tmp_path / "render" / "frame_0.png"), truth.color) > 20
    recolored = read_photo(tmp_path / "recolor" / "frame_0.png")
    ball = recolored[truth.labels == 1].mean(0)
    assert ball[1] > ball[0]
    assert not (learned.project / "planes" / "frame_0.npz").exists()
    edit = read_edit(green, read_palettes(Project(learned.project).palette_file))
    layered = read_photo(tmp_path / "recolor" / "frame_0_layered.exr")
    assert np.abs(layered - recolored).max() < 1 / 255
    result, depth = recomposed(tmp_path / "layers" / "frame_0.exr", edit)
    assert np.abs(result - recolored).max() < 1 / 255
    np.testing.assert_array_equal(depth, np.load(tmp_path / "depth" / "frame_0.npy"))


def test_palettes_print_as_json(learned, capsys):
    assert run("palette", learned.project, "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(Project(learned.project).palette_file.read_text())
    for entry in printed["objects"]:
        assert entry["colors"][0] == [0, 0, 0] and len(entry["colors"]) >= 2


@pytest.mark.parametrize("suffix", [".gpl", ".ase", ".json"])
def test_palette_formats_round_trip_as_an_edit(learned, green, tmp_path, suffix):
    palettes = read_palettes(Project(learned.project).palette_file)
    foreign, back = tmp_path / f"p{suffix}", tmp_path / "b.json"
    assert run("palette", learned.project, "--edit", green, "--out", foreign) == 0
    assert run("palette", learned.project, "--edit", foreign, "--out", back) == 0
    before, after = read_edit(green, palettes), read_edit(back, palettes)
    for name, colors in before.colors.items():
        assert np.abs(np.clip(colors, 0, 1) - np.clip(after.colors[name], 0, 1)).max() <= 0.5 / 255 + 1e-6
    assert run("palette", learned.project, "--out", foreign) == 0
    assert run("palette", learned.project, "--edit", foreign) == 2


def test_edit_matched_from_a_painted_view_fits_other_views(still_life, learned, frames, tmp_path):
    view, *_ = pictures = sorted((frames / "recolor").glob("*.png"))
    out, again = tmp_path / "matched.json", tmp_path / "again"
    words = ("--view", view.stem, "--picture", view, "--out", out, "--threads", 1)
    assert run("match", learned.project, *words) == 0
    assert run("render", learned.project, "--views", "test", "--edit", out, "--out", again, "--threads", 1) == 0
    capture = open_capture(still_life.capture)
    for path in pictures:
        files = path, again / "recolor" / path.name, capture.view(path.stem).image
        wanted, made, photo = (iio.imread(file)[..., :3] / 255.0 for file in files)
        inside = np.abs(wanted - photo).max(axis=-1) > 0.1
        assert np.abs(made - wanted)[inside].mean() < 0.05 * np.abs(photo - wanted)[inside].mean()


def test_unchanged_or_wrongly_sized_picture_is_rejected(still_life, learned, tmp_path):
    view = open_capture(still_life.capture).split("test")[0]
    iio.imwrite(tmp_path / "wide.png", np.zeros((20, 80, 3), np.uint8))
    match = ("match", learned.project, "--out", tmp_path / "out.json", "--view", view.name)
    for picture in (("--picture", view.image), ("--picture", tmp_path / "wide.png"), ()):
        assert run(*match, *picture) == 2
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize("rule", ["becomes", "paint", "fewest"])
def test_matched_edits_change_one_object_and_combine(learned, green, tmp_path, rule):
    out = tmp_path / "both.json"
    words = ("--object", "block", "--from", "#2042b0", "--to", "#d0c020", "--rule", rule, "--edit", green, "--out", out)
    assert run("match", learned.project, *words) == 0
    palettes = read_palettes(Project(learned.project).palette_file)
    block = {palette.name: palette.colors for palette in palettes}["block"]
    first, both = read_edit(green, palettes), read_edit(out, palettes)
    assert np.array_equal(first.colors["ball"], both.colors["ball"])
    assert np.array_equal(first.colors["block"], block) and not np.array_equal(both.colors["block"], block)
    assert all(rgb_to_hex(colors[0]) == "#000000" for colors in both.colors.values())


def test_every_command_has_the_same_signature_and_can_be_a_job():
    for name in (name for name, kind in COMMANDS.items() if kind is not LearnOptions):
        run = import_module(f"karf_engine.commands.{name.replace('-', '_')}").run
        assert list(inspect.signature(run).parameters)[:3] == ["options", "emit", "should_stop"], name
    assert STAGES == (*COMMANDS, WARM)


def test_run_command_returns_the_commands_result(still_life, tmp_path, events):
    inspect_options = InspectOptions.of(capture=still_life.capture, out=tmp_path / "inspected")
    advice = run_command(inspect_options, events, lambda: False)
    assert advice.findings and (tmp_path / "inspected" / "inspection.json").exists()
    box = {"view": "train_r_0", "object_name": "ball", "box": (8, 8, 20, 20)}
    mark_options = MarkOptions.of(capture=still_life.capture, masks=tmp_path / "masks", **box)
    mask = run_command(mark_options, events, lambda: False)
    assert mask.is_file() and events.values("artifact", "path") == [str(tmp_path / "inspected"), str(mask)]
