"""The cache of renderings and mattes is reused while nothing changes and repaired if it is damaged."""

import shutil
from dataclasses import replace
from unittest.mock import Mock

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
def uncached(copy):
    """A copied project with an empty cache."""
    shutil.rmtree(copy.render_cache_folder, ignore_errors=True)
    return copy


@pytest.fixture
def record_calls(monkeypatch):
    """Record the arguments of each call of a function of a class or module."""

    def record_calls(owner, name):
        calls, function = [], getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *arguments: (calls.append(arguments), function(*arguments))[1])
        return calls

    return record_calls


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


def test_rendering_is_reused_only_for_same_camera_and_scene(uncached, record_calls):
    renders, first = record_calls(Scene, "render"), rendered(uncached)
    assert np.array_equal(rendered(uncached), first) and len(renders) == 1
    model = Model(uncached)
    camera = model.working_camera(model.capture.split("test")[0])
    model.render_field(replace(camera, cx=camera.cx + 1e-6))
    assert len(renders) == 2
    finish_again(uncached.folder, "segmentation")
    rendered(uncached)
    assert len(renders) == 3 and len(cached(uncached, render_cache.SCHEMA)) == 1  # only that of the present scene


def change_file(path, schema, fits, tensors, **facts):
    """Change a file of the cache; fits: whether its checksum is updated."""
    known, known_facts = load_tensors(path, schema)
    known |= tensors
    checksum = {"checksum": render_cache._checksum(known)} if fits else {}
    save_tensors(path, known, schema, known_facts | checksum | facts)


def change_mattes(path, tensors=(), **facts):
    change_file(path, render_cache.MATTES, True, dict(tensors), **facts)


FAR = {"0.mixed": torch.tensor([10**9]), "0.mixed_colors": torch.zeros(1, 3, dtype=torch.uint8)}
DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "not tensors": lambda path: path.write_bytes(b"no tensors at all"),
    "altered": lambda path: change_file(path, render_cache.SCHEMA, False, {"color": torch.full((32, 32, 3), 0.5)}),
}
DAMAGE_OF_MATTES = {
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "of another box": lambda path: change_mattes(path, {"0.coverage": torch.zeros(1, 1)}),
    "mixed outside": lambda path: change_mattes(path, FAR),
    "of other objects": lambda path: change_mattes(path, places=[]),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_damaged_rendering_is_made_again(uncached, record_calls, damage):
    renders, first = record_calls(Scene, "render"), rendered(uncached)
    damage(*cached(uncached, render_cache.SCHEMA))
    assert np.array_equal(rendered(uncached), first) and len(renders) == 2


@pytest.mark.parametrize("damage", DAMAGE_OF_MATTES.values(), ids=DAMAGE_OF_MATTES)
def test_mattes_are_reused_for_other_edits_and_remade_if_damaged(uncached, record_calls, damage):
    made_mattes, first = record_calls(render_cache, "make_mattes"), recolored(uncached)
    assert np.array_equal(recolored(uncached), first) and [edges for edges, *_ in made_mattes] == ["photo"]
    damage(*cached(uncached, "karf-mattes"))
    assert np.array_equal(recolored(uncached), first) and len(made_mattes) == 2


def test_mattes_of_another_photo_size_or_mask_are_not_reused(uncached, record_calls):
    made_mattes, model = record_calls(render_cache, "make_mattes"), Model(uncached)
    view, other = model.capture.split("train")[:2]
    for photo, *size in ((view,), (view, 24), (replace(view, image=other.image),)):
        model.photo_view(photo, *size)
    assert len(made_mattes) == 3
    mask = uncached.masks_folder / "ball" / f"{view.name}.png"
    for inside in (1, 2, 2):
        drawn = np.zeros((view.camera.height, view.camera.width), np.uint8)
        drawn[:inside] = 255
        write_png(mask, drawn)
        Model(uncached).photo_view(view)
    assert len(made_mattes) == 5


def test_only_own_earlier_renderings_are_removed(uncached, tmp_path):
    earlier, elsewhere = uncached.render_cache_folder / ("0" * 16), tmp_path / "models"
    for folder in (earlier, elsewhere, uncached.render_cache_folder / "mine"):
        folder.mkdir(parents=True)
        for name in ("1" * 16, "lora"):
            (folder / f"{name}.safetensors").write_bytes(b"")
    (uncached.render_cache_folder / ("2" * 16)).symlink_to(elsewhere)
    rendered(uncached)
    assert [path.name for path in earlier.iterdir()] == ["lora.safetensors"]
    assert len(list(elsewhere.iterdir())) == 2 and len(list((uncached.render_cache_folder / "mine").iterdir())) == 2


def test_read_only_project_is_rendered(uncached, monkeypatch):
    monkeypatch.setattr(render_cache, "save_tensors", Mock(side_effect=PermissionError("read only")))
    assert rendered(uncached).any()


def test_cache_size_is_limited(uncached, monkeypatch):
    model = Model(uncached)
    views = model.capture.split("train")[:3]
    model.render_field(model.working_camera(views[0]))
    (one,) = cached(uncached, render_cache.SCHEMA)
    monkeypatch.setattr(render_cache, "MOST_BYTES", int(2.5 * one.stat().st_size))
    for view in views:
        model.render_field(model.working_camera(view))
    assert len(cached(uncached, render_cache.SCHEMA)) == 2
