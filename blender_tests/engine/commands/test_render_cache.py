"""The cache of renderings and mattes: reused while nothing has changed, made again where it is damaged."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from blender_tests.engine.conftest import finish_again
from karf_engine.fields.scene import Scene
from karf_engine.io.checkpoints import load_tensors, save_tensors
from karf_engine.io.images import write_png
from karf_engine.palettes.palette import Edit
from karf_engine.recolor import render_cache
from karf_engine.recolor.model import Model


@pytest.fixture
def unseen(copy):
    """A copied project with an empty cache."""
    shutil.rmtree(copy.render_cache_folder, ignore_errors=True)
    return copy


def noting(monkeypatch, owner, name):
    """Record the calls of a function of a class or module in a list."""
    calls, function = [], getattr(owner, name)

    def note(*arguments):
        calls.append(arguments)
        return function(*arguments)

    monkeypatch.setattr(owner, name, note)
    return calls


@pytest.fixture
def renders(monkeypatch):
    """The renderings of the field."""
    return noting(monkeypatch, Scene, "render")


@pytest.fixture
def refined(monkeypatch):
    """The mattes that were made."""
    return noting(monkeypatch, render_cache, "make_mattes")


def first_test_view(project):
    return Model(project).capture.split("test")[0]


def rendered(project):
    """A rendering of a test view by a newly loaded model."""
    model = Model(project)
    frame = model.render_field(model.working_camera(model.capture.split("test")[0]))
    return np.concatenate([np.ravel(part) for part in (frame.color, frame.depth, frame.opacity, frame.probabilities)])


def recolored(project):
    """The photo of a test view with a green first object, by a newly loaded model."""
    model = Model(project)
    colors = {palette.name: palette.colors.copy() for palette in model.palettes}
    colors[model.objects[0]][1:] = [0.1, 0.9, 0.2]
    return model.photo_view(model.capture.split("test")[0]).recolor(Edit(colors)).pixels


def cached(project, schema):
    """The cache's files of a schema."""
    files = project.render_cache_folder.rglob("*.safetensors")
    return [path for path in files if schema.encode() in path.read_bytes()[:4096]]


def test_a_rendering_is_taken_again_for_the_same_camera_and_scene_alone(unseen, renders):
    first = rendered(unseen)
    assert np.array_equal(rendered(unseen), first) and len(renders) == 1
    model = Model(unseen)
    camera = model.working_camera(first_test_view(unseen))
    model.render_field(replace(camera, cx=camera.cx + 1e-6))
    assert len(renders) == 2
    finish_again(unseen.folder, "segmentation")
    rendered(unseen)
    assert len(renders) == 3 and len(cached(unseen, render_cache.SCHEMA)) == 1  # those of the scene before are gone


def changed(path, schema, is_noted, tensors, **facts):
    """Change a file of the cache; is_noted: its checksum fits."""
    known, noted = load_tensors(path, schema)
    known |= tensors
    checksum = {"checksum": render_cache._checksum(known)} if is_noted else {}
    save_tensors(path, known, schema, noted | checksum | facts)


def changed_mattes(path, tensors=(), **facts):
    changed(path, render_cache.MATTES, True, dict(tensors), **facts)


FAR = {"0.mixed": torch.tensor([10**9]), "0.mixed_colors": torch.zeros(1, 3, dtype=torch.uint8)}
DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "no tensors": lambda path: path.write_bytes(b"no tensors at all"),
    "altered": lambda path: changed(path, render_cache.SCHEMA, False, {"color": torch.full((32, 32, 3), 0.5)}),
}
DAMAGE_OF_MATTES = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "of another box": lambda path: changed_mattes(path, {"0.coverage": torch.zeros(1, 1)}),
    "mixed outside": lambda path: changed_mattes(path, FAR),
    "of other objects": lambda path: changed_mattes(path, places=[]),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_rendering_is_made_again(unseen, renders, damage):
    first = rendered(unseen)
    damage(*cached(unseen, render_cache.SCHEMA))
    assert np.array_equal(rendered(unseen), first) and len(renders) == 2


@pytest.mark.parametrize("damage", DAMAGE_OF_MATTES.values(), ids=DAMAGE_OF_MATTES)
def test_mattes_are_taken_again_for_another_edit_and_made_again_where_damaged(unseen, refined, damage):
    first = recolored(unseen)
    assert np.array_equal(recolored(unseen), first) and [edges for edges, *_ in refined] == ["photo"]
    damage(*cached(unseen, "karf-mattes"))
    assert np.array_equal(recolored(unseen), first) and len(refined) == 2


def test_mattes_of_another_photo_size_or_mask_are_not_taken(unseen, refined):
    model = Model(unseen)
    view, other = model.capture.split("train")[:2]
    for photo, *size in ((view,), (view, 24), (replace(view, image=other.image),)):
        model.photo_view(photo, *size)
    assert len(refined) == 3
    mask = unseen.masks_folder / "ball" / f"{view.name}.png"
    for inside in (1, 2, 2):
        drawn = np.zeros((view.camera.height, view.camera.width), np.uint8)
        drawn[:inside] = 255
        write_png(mask, drawn)
        Model(unseen).photo_view(view)
    assert len(refined) == 5


def test_of_earlier_renderings_only_what_was_written_here_is_removed(unseen, tmp_path):
    earlier, elsewhere = unseen.render_cache_folder / ("0" * 16), tmp_path / "models"
    for folder in (earlier, elsewhere, unseen.render_cache_folder / "mine"):
        folder.mkdir(parents=True)
        for name in ("1" * 16, "lora"):
            (folder / f"{name}.safetensors").write_bytes(b"")
    (unseen.render_cache_folder / ("2" * 16)).symlink_to(elsewhere)
    rendered(unseen)
    assert [path.name for path in earlier.iterdir()] == ["lora.safetensors"]
    assert len(list(elsewhere.iterdir())) == 2 and len(list((unseen.render_cache_folder / "mine").iterdir())) == 2


def test_a_project_that_cannot_be_written_to_is_rendered_all_the_same(unseen, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError("read only")

    monkeypatch.setattr(render_cache, "save_tensors", refuse)
    assert rendered(unseen).any()


def test_no_more_is_kept_than_may_be(unseen, monkeypatch):
    model = Model(unseen)
    views = model.capture.split("train")[:3]
    model.render_field(model.working_camera(views[0]))
    (one,) = cached(unseen, render_cache.SCHEMA)
    monkeypatch.setattr(render_cache, "MOST_BYTES", int(2.5 * one.stat().st_size))
    for view in views:
        model.render_field(model.working_camera(view))
    assert len(cached(unseen, render_cache.SCHEMA)) == 2
