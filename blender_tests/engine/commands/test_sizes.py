"""Photos recolored at full size and cameras rendered at any size, on the learned still life."""

import shutil
from dataclasses import replace
from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

import karf_engine as karf
from blender_tests.engine.commands.conftest import cameras_file, geometry_command, run
from blender_tests.engine.reference.still_life import camera_at, take_photo
from karf_engine.capture.capture import View
from karf_engine.capture.distortion import undistort_points
from karf_engine.errors import BadRequest, DataError
from karf_engine.export.finished_frames import frame_fingerprint
from karf_engine.io.color import to_bytes
from karf_engine.io.color_spaces import color_space
from karf_engine.io.images import INVERSE_EXIF_ORIENTATION as INVERSE
from karf_engine.io.images import apply_exif_orientation_copy, encode_image, read_mask, read_photo
from karf_engine.metrics.masks import iou
from karf_engine.palettes.compositing import delta_composite, stack_palettes
from karf_engine.project import STAGE_ORDER, Project
from karf_engine.project.contents import read_capture
from karf_engine.project.state import write_state
from karf_engine.recolor.full_resolution import make_photo_view
from karf_engine.recolor.matting.photo_mattes import field_mattes
from karf_engine.recolor.matting.thin_parts import Marks
from karf_engine.recolor.photos import open_photo, write_photo

CAMERA = camera_at(0.2, 0.6, 96)  # three times the learned size


@pytest.fixture(scope="module")
def model(learned):
    model = karf.load(learned.project, device="cpu")
    model.settings = replace(model.settings, render=replace(model.settings.render, edges="field"))
    return model


@pytest.fixture(scope="module")
def green(model):
    return model.edit().becomes("ball", "#c0221a", "#1ec040")


@pytest.fixture(scope="module")
def added(model):
    """An edit with an added color."""
    return model.edit().add_color("ball", "#c0221a", "#1ec040")


@pytest.fixture(scope="module")
def photo():
    return take_photo(CAMERA)


def save_photo(path, color, orientation=1, is_upright=False, camera=CAMERA):
    """Save a photo that viewers show as `color`, with an Exif orientation; returns its view.

    is_upright: the stored pixels are `color`, whatever the orientation says.
    """
    tags, pixels = Image.Exif(), to_bytes(color)
    tags[0x0112] = orientation
    if not is_upright:
        pixels = apply_exif_orientation_copy(pixels, INVERSE.get(orientation, orientation))
    Image.fromarray(pixels).save(path, exif=tags)
    return View(path.stem, path.stem, camera, path, "test")


def test_edit_recolors_full_photo_and_changes_nothing_else(model, green, photo, tmp_path):
    view = save_photo(tmp_path / "a.png", photo.color)
    ready = model.photo_view(view)
    write_photo(tmp_path / "b.png", ready.recolor(green))
    before, after = open_photo(view.image).pixels, open_photo(tmp_path / "b.png").pixels
    ball, matte = ready.masks()[0], ready.mattes[0]
    assert after.shape == (96, 96, 3)
    assert iou(ball, photo.labels == 1) > 0.6 and after[ball, 1].mean() > 2 * after[ball, 0].mean()
    unreached = np.ones((96, 96), bool)
    unreached[slice(*matte.rows), slice(*matte.columns)] = matte.coverage == 0
    assert_array_equal(after[unreached], before[unreached])
    assert_array_equal(to_bytes(model.recolor(view, green)), after)


@pytest.mark.parametrize("orientation", range(2, 9))
def test_exif_orientation_is_kept_and_does_not_matter(model, green, photo, tmp_path, orientation):
    plain = model.recolor(save_photo(tmp_path / "a.png", photo.color), green)
    view = save_photo(tmp_path / "b.png", photo.color, orientation)
    write_photo(tmp_path / "c.png", model.photo_view(view).recolor(green))
    assert open_photo(tmp_path / "c.png").header.orientation == orientation
    assert_allclose(read_photo(tmp_path / "c.png"), plain, atol=1.1 / 255)
    assert_allclose(model.recolor(view, green), plain, atol=1.1 / 255)


def test_camera_of_the_stored_photo_is_accepted(model, green, tmp_path):
    wide = replace(CAMERA, height=72, cy=36.0)
    color = take_photo(wide).color
    plain = save_photo(tmp_path / "a.png", color, camera=wide)
    tagged = save_photo(tmp_path / "b.png", color, 6, is_upright=True, camera=wide)
    assert_array_equal(model.recolor(tagged, green), model.recolor(plain, green))
    with pytest.raises(DataError, match="96x72 pixels where its camera has 96x96"):
        model.photo_view(replace(tagged, camera=CAMERA))


def test_lens_distortion_is_respected(model, tmp_path):
    bent = replace(CAMERA, distortion=(2.0, 0.0, 0.02, -0.02))

    class Lens:
        width, height, camera_to_world = 96, 96, CAMERA.camera_to_world
        pixel_centers = staticmethod(CAMERA.pixel_centers)
        rays = staticmethod(lambda pixels: CAMERA.rays(undistort_points(bent, pixels)))

    truth = take_photo(Lens)
    view = save_photo(tmp_path / "a.png", truth.color)
    found = [model.photo_view(each).masks()[1] for each in (replace(view, camera=bent), view)]
    scores = [iou(mask, truth.labels == 2) for mask in found]
    assert scores[0] > 0.7 and scores[0] > scores[1] + 0.05


@pytest.mark.parametrize("orientation", [1, 6])
def test_rough_masks_use_the_stored_photos_grid(model, photo, tmp_path, orientation):
    matting = Mock(side_effect=lambda shown, probabilities, *_: field_mattes(shown.shape[1::-1], probabilities))
    view = save_photo(tmp_path / "a.png", photo.color, orientation)
    frame = model.render_field(model.working_camera(view))
    bright = to_bytes(photo.color)[..., 0] > 127
    make_photo_view(view, "photo", frame, Marks(bright[None], (False,)), matting, model.objects, model.palettes)
    (((shown, _, _, marks), _),) = matting.call_args_list
    assert_array_equal(marks.drawn[0], shown[..., 0] > 127)


def test_several_edits_share_one_photo_view(model, green, photo, tmp_path):
    ready = model.photo_view(save_photo(tmp_path / "a.png", photo.color))
    edits = [green, model.edit(), model.edit().swatch("block", 1, "#ffffff"), replace(green, compositing="paper")]
    together = [copy.pixels for copy in ready.recolor_all(edits)]
    assert_array_equal(together, [ready.recolor(edit).pixels for edit in edits])
    assert_array_equal(together[1], ready.photo.pixels)
    objects = ready.masks().any(0)
    assert_array_equal(together[3][~objects], ready.photo.pixels[~objects])
    assert (together[3][objects] != together[0][objects]).any()


def test_learned_size_equals_photo_size_for_small_photos(model, green, added):
    view = model.capture.split("test")[0]
    for edit in (green, added, replace(added, compositing="paper")):
        shown = to_bytes(model.recolor(view, edit))
        assert_array_equal(shown, to_bytes(model.recolor(view, edit, "learned")))
        assert (shown != to_bytes(model.recolor(view, model.edit()))).any()
    plain = model.composite(model.render_view(view), green)
    assert_array_equal(to_bytes(model.recolor(view, green)), to_bytes(plain))


def test_photo_layers_reproduce_an_added_color(model, added, photo, tmp_path):
    ready = model.photo_view(save_photo(tmp_path / "a.png", photo.color, 6))
    layers = ready.layers(np.ones((2, 2)), added.added)
    learned = stack_palettes(model.objects, {palette.name: palette.colors for palette in layers.palettes})
    edited = stack_palettes(model.objects, added.colors)
    result = delta_composite(layers.base.astype(np.float32) / 255, layers.palette_weights, learned, edited)
    assert_allclose(result, ready.over_white(ready.recolor(added)), atol=1.6 / 255)


def test_added_color_changes_the_frame_fingerprint(model, added):
    further = replace(added, added={"ball": (replace(added.added["ball"][0], reach=2.0),)})
    assert len({frame_fingerprint("view", each) for each in (model.edit(), added, further)}) == 3


@pytest.fixture
def render(learned, tmp_path):
    """Render into a folder `out`; returns the exit code."""
    return partial(run, "render", learned.project, "--out", tmp_path / "out", "--threads", 1)


@pytest.mark.parametrize(("size", "pixels"), [("photo", 32), ("learned", 32), ("12", 12), ("500", 32)])
def test_render_writes_the_requested_size(render, green, tmp_path, size, pixels):
    green.save(tmp_path / "green.json")
    assert render("--views", "test_r_0", "--edit", tmp_path / "green.json", "--size", size) == 0
    assert read_photo(tmp_path / "out" / "recolor" / "test_r_0.png").shape == (pixels, pixels, 3)
    assert read_mask(tmp_path / "out" / "masks" / "ball" / "test_r_0.png").shape == (pixels, pixels)
    assert read_photo(tmp_path / "out" / "render" / "test_r_0.png").shape == (32, 32, 3)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        *((f"--size={size}", "is not a size") for size in ("0", "-3", "huge", "2.5")),
        ("--set=geometry.long_side=64", "Only settings of render"),
    ],
)
def test_invalid_sizes_and_settings_are_rejected(render, capsys, option, message):
    assert render(option) == BadRequest.exit_code
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("size", ["photo", "learned"])
def test_disputed_objects_are_reported_once(render, capsys, monkeypatch, size):
    def dispute_first_object(self, edges, photo, probabilities, rendered, marks, seed):
        first, *others = field_mattes(photo.shape[1::-1], probabilities)
        return [replace(first, disputed=True), *others]

    monkeypatch.setattr("karf_engine.recolor.render_cache.RenderCache.mattes", dispute_first_object)
    assert render("--views", "test_r_0,train_r_0", "--size", size, "--planes") == 0
    printed = "".join(capsys.readouterr())
    assert printed.count("disagree") == 1
    assert "disagree about ball in test_r_0, train_r_0: its edges there are the scene's" in printed


def test_render_settings_are_optional_and_not_fingerprinted(copy):
    state = copy.state()
    assert "render" not in STAGE_ORDER
    assert all("edges" not in copy.finished(stage)["settings"] for stage in STAGE_ORDER)
    del state["settings"]["render"]
    write_state(copy.state_file, state)
    assert karf.load(copy.folder, device="cpu").settings.render.edges == "photo"


@pytest.mark.parametrize(("kind", "suffix"), [("png8", "png"), ("exr16", "exr")])
def test_camera_renders_with_alpha_and_supersampling(render, green, tmp_path, kind, suffix):
    cameras, truth = cameras_file(tmp_path / "path.json", size=24), take_photo(camera_at(1.0, 0.5, size=24))
    green.save(tmp_path / "green.json")
    options = ("--edit", tmp_path / "green.json", "--alpha", "--depth", "--set", "render.supersampling=3")
    assert render("--views", cameras, *options, "--format", kind) == 0
    rendered = read_photo(tmp_path / "out" / "render" / "frame_0.png")
    for picture in (rendered, read_photo(tmp_path / "out" / "recolor" / f"frame_0.{suffix}")):
        assert np.abs(picture[..., 3] - truth.alpha).mean() < 0.08
    solid = truth.alpha > 0.99
    assert np.abs(rendered[solid][:, :3] - truth.color[solid]).mean() < 0.1
    depth = np.load(tmp_path / "out" / "depth" / "frame_0.npy")
    assert depth.shape == (24, 24) and 2.4 < np.median(depth[truth.labels == 1]) < 3.8


def test_rendering_in_bands_gives_the_same_picture(model, monkeypatch):
    camera = camera_at(1.0, 0.5, size=24)
    whole = model.render(camera, 2)
    monkeypatch.setattr("karf_engine.recolor.frames.BAND_RAYS", 24 * 2 * 2 * 5)
    bands = model.render(camera, 2)
    for name in ("color", "depth", "opacity", "probabilities", "palette_weights", "base"):
        assert_allclose(getattr(bands, name), getattr(whole, name), atol=1e-4)


def test_wide_gamut_photos_are_recolored_like_srgb_ones(still_life, learned, tmp_path, capsys):
    pytest.importorskip("PyOpenColorIO")
    wide_space = "sRGB Encoded P3-D65"
    wide = shutil.copytree(still_life.capture, tmp_path / "wide" / "capture")
    for path in wide.rglob("*.png"):
        stored = color_space(wide_space).from_srgb(read_photo(path)[..., :3])
        path.write_bytes(encode_image(".png", np.rint(np.clip(stored, 0, 1) * 65535).astype(np.uint16)))
    project, edit = tmp_path / "project", tmp_path / "edit.json"
    assert run("geometry", wide, "--project", project, "--photo-space", "P3 sRGB") == BadRequest.exit_code
    printed = capsys.readouterr().err
    assert "no color space 'P3 sRGB'" in printed and "Nearest: " in printed and wide_space in printed
    assert not project.exists()

    of_wide = replace(still_life, capture=wide)
    command = of_wide.command(project, "splats.iterations=1", "recoloring.iterations=20")
    assert run(*command, "--photo-space", wide_space) == 0
    assert {view.space.name for view in read_capture(Project(project)).views} == {wide_space}
    pictures = []
    for each, space in ((learned.project, None), (project, color_space(wide_space))):
        out = tmp_path / f"of {each.parent.name}"
        assert run("match", each, "--object", "ball", "--from", "#d92619", "--to", "#1f5fbf", "--out", edit) == 0
        assert run("render", each, "--views", "test_r_0", "--edit", edit, "--out", out) == 0
        pictures.append(read_photo(out / "recolor" / "test_r_0.png", space=space)[..., :3])
    change = np.abs(pictures[0] - pictures[1])
    assert change.mean() < 0.01 and change.max() < 0.1
    before, after = open_photo(wide / "test" / "r_0.png"), open_photo(out / "recolor" / "test_r_0.png")
    assert after.pixels.dtype == np.uint16 and 0.5 < (before.pixels == after.pixels).all(-1).mean() < 0.99
    capsys.readouterr()
    assert run(*geometry_command(of_wide, project)) == 0  # a project keeps its color space
    assert "already done" in capsys.readouterr().err
