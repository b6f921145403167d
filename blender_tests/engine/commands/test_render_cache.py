"""What the field says of captured views is asked once: kept in the project, and taken again where nothing has changed."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine.recolor.render_cache
from blender_tests.engine.conftest import finish_again
from karf_engine.cli import main
from karf_engine.fields.scene import Scene
from karf_engine.io.checkpoints import load_tensors, save_tensors
from karf_engine.io.images import write_png
from karf_engine.palettes.palette import Edit
from karf_engine.project import Project
from karf_engine.recolor.model import Model


@pytest.fixture
def copy(learned, tmp_path):
    """A project of one's own, in which nothing has been looked at."""
    project = Project(shutil.copytree(learned.project, tmp_path / "project"))
    shutil.rmtree(project.render_cache_folder, ignore_errors=True)
    return project


@pytest.fixture
def renders(monkeypatch):
    """The cameras that the field was rendered for."""
    cameras, render = [], Scene.render

    def note(scene, camera, n_quantiles):
        cameras.append(camera)
        return render(scene, camera, n_quantiles)

    monkeypatch.setattr(Scene, "render", note)
    return cameras


def first_test_view(model):
    return model.capture.split("test")[0]


def seen(frame):
    return [frame.color, frame.depth, frame.opacity, frame.probabilities]


def test_another_model_of_the_project_renders_no_field_again_and_sees_the_same_bits(copy, renders):
    model = Model(copy)
    camera = model.working_camera(first_test_view(model))
    first, again = model.render_field(camera), Model(copy).render_field(camera)
    assert len(renders) == 1
    assert all(np.array_equal(a, b) for a, b in zip(seen(first), seen(again), strict=True))


def test_frames_of_a_second_edit_are_those_of_a_project_that_was_never_looked_at(copy, renders, tmp_path):
    def frames(name):
        out = tmp_path / name
        assert (
            main(["render", str(copy.folder), "--views", "test", "--depth", "--out", str(out), "--threads", "1"]) == 0
        )
        files = [path for path in sorted(out.rglob("*")) if path.is_file() and path.suffix != ".jsonl"]
        return {path.relative_to(out): path.read_bytes() for path in files}

    first = frames("first")
    rendered = len(renders)
    assert frames("second") == first
    assert len(renders) == rendered


def test_a_look_of_another_camera_is_not_taken(copy, renders):
    model = Model(copy)
    camera = model.working_camera(first_test_view(model))
    model.render_field(camera)
    Model(copy).render_field(replace(camera, cx=camera.cx + 1e-6))
    assert len(renders) == 2


def test_what_was_learned_anew_is_looked_at_anew_and_old_looks_go(copy, renders):
    model = Model(copy)
    camera = model.working_camera(first_test_view(model))
    model.render_field(camera)
    finish_again(copy.folder, "segmentation")
    Model(copy).render_field(camera)
    assert len(renders) == 2
    assert len(list(copy.render_cache_folder.rglob("*.safetensors"))) == 1


@pytest.fixture
def refined(monkeypatch):
    """The edges that mattes were asked for."""
    edges, mattes_of = [], karf_engine.recolor.render_cache.make_mattes

    def note(wanted, *arrays):
        edges.append(wanted)
        return mattes_of(wanted, *arrays)

    monkeypatch.setattr(karf_engine.recolor.render_cache, "make_mattes", note)
    return edges


def recolored(project, view):
    """The pixels of a photo, all of its first object made green, by a model that is loaded anew."""
    model = Model(project)
    colors = {palette.name: palette.colors.copy() for palette in model.palettes}
    colors[model.objects[0]][1:] = [0.1, 0.9, 0.2]
    return model.photo_view(view).recolor(Edit(colors)).pixels


def test_a_second_edit_of_a_photo_refines_no_edge_again_and_comes_out_in_the_same_bits(copy, refined):
    view = first_test_view(Model(copy))
    first, again = recolored(copy, view), recolored(copy, view)
    assert refined == ["photo"] and np.array_equal(first, again)


def test_mattes_of_another_photo_or_another_size_are_not_taken(copy, refined):
    model = Model(copy)
    view, other = model.capture.split("train")[:2]
    model.photo_view(view)
    model.photo_view(view, 24)
    model.photo_view(replace(view, image=other.image))
    assert len(refined) == 3


def test_mattes_of_a_photo_that_is_marked_otherwise_by_now_are_not_taken(copy, refined):
    model = Model(copy)
    view = first_test_view(model)
    model.photo_view(view)
    mask = copy.masks_folder / model.objects[0] / f"{view.name}.png"
    for inside in (1, 2, 2):
        drawn = np.zeros((view.camera.height, view.camera.width), np.uint8)
        drawn[:inside] = 255
        write_png(mask, drawn)
        Model(copy).photo_view(view)
    assert len(refined) == 3


@pytest.mark.parametrize("damage", ["cut off", "of another box", "of other objects"])
def test_damaged_mattes_are_refined_again(copy, refined, damage):
    view = first_test_view(Model(copy))
    first = recolored(copy, view)
    (path,) = (path for path in copy.render_cache_folder.glob("*/*") if b"karf-mattes" in path.read_bytes()[:4096])
    tensors, facts = load_tensors(path, karf_engine.recolor.render_cache.MATTES)
    if damage == "cut off":
        path.write_bytes(path.read_bytes()[:-1])
    elif damage == "of another box":
        save_tensors(path, tensors | {"0.coverage": torch.zeros(1, 1)}, karf_engine.recolor.render_cache.MATTES, facts)
    else:
        save_tensors(path, tensors, karf_engine.recolor.render_cache.MATTES, {"places": facts["places"][:-1]})
    assert np.array_equal(recolored(copy, view), first) and len(refined) == 2


@pytest.mark.parametrize("damage", [b"", b"no tensors at all"])
def test_a_damaged_look_is_rendered_again(copy, renders, damage):
    model = Model(copy)
    camera = model.working_camera(first_test_view(model))
    first = model.render_field(camera)
    (path,) = copy.render_cache_folder.rglob("*.safetensors")
    path.write_bytes(damage)
    assert np.array_equal(Model(copy).render_field(camera).color, first.color)
    assert len(renders) == 2


def test_a_look_whose_numbers_were_altered_is_rendered_again(copy, renders):
    model = Model(copy)
    camera = model.working_camera(first_test_view(model))
    first = model.render_field(camera)
    (path,) = copy.render_cache_folder.rglob("*.safetensors")
    tensors, facts = load_tensors(path, karf_engine.recolor.render_cache.SCHEMA)
    tensors["color"][:10, :10] = 0.5
    save_tensors(path, tensors, karf_engine.recolor.render_cache.SCHEMA, facts)
    assert np.array_equal(Model(copy).render_field(camera).color, first.color)
    assert len(renders) == 2


def test_of_earlier_looks_only_what_was_written_here_is_removed(copy, tmp_path):
    earlier, elsewhere = copy.render_cache_folder / ("0" * 16), tmp_path / "models"
    for folder in (earlier, elsewhere, copy.render_cache_folder / "mine"):
        folder.mkdir(parents=True)
        for name in ("1" * 16, "lora"):
            (folder / f"{name}.safetensors").write_bytes(b"")
    (copy.render_cache_folder / ("2" * 16)).symlink_to(elsewhere)
    model = Model(copy)
    model.render_field(model.working_camera(first_test_view(model)))
    assert [path.name for path in earlier.iterdir()] == ["lora.safetensors"]
    assert len(list(elsewhere.iterdir())) == 2 and len(list((copy.render_cache_folder / "mine").iterdir())) == 2


def test_a_project_that_cannot_be_written_to_is_rendered_all_the_same(copy, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError("read only")

    monkeypatch.setattr(karf_engine.recolor.render_cache, "save_tensors", refuse)
    model = Model(copy)
    assert model.render_field(model.working_camera(first_test_view(model))).color.any()


def test_no_more_is_kept_than_may_be(copy, monkeypatch):
    model = Model(copy)
    views = model.capture.split("train")[:3]
    model.render_field(model.working_camera(views[0]))
    (one,) = copy.render_cache_folder.rglob("*.safetensors")
    monkeypatch.setattr(karf_engine.recolor.render_cache, "MOST_BYTES", int(2.5 * one.stat().st_size))
    for view in views:
        model.render_field(model.working_camera(view))
    assert len(list(copy.render_cache_folder.rglob("*.safetensors"))) == 2
