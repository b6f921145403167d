"""Bundles hold all that a farm's job reads, with paths inside the bundle, and nothing else."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

import karf_engine as karf
from blender_tests.engine.commands.conftest import geometry_command
from blender_tests.engine.commands.farm.sequences import Sequence
from karf_engine.cli import main
from karf_engine.commands.farm import run as write_bundle
from karf_engine.commands.options import FarmOptions
from karf_engine.errors import BadRequest, DataError
from karf_engine.io.files import checksum, read_json
from karf_engine.palettes.palette import Edit, write_edit
from karf_engine.project import Project
from karf_engine.project.contents import read_capture
from karf_engine.project.state import write_state


@pytest.fixture
def sequence(learned, tmp_path):
    return Sequence(learned.project, tmp_path, 5)


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_bundle_paths_stay_inside_it(learned, still_life, sequence, tmp_path):
    bundle = karf.render_bundle(learned.project, tmp_path / "bundle", views="all", edit=sequence.edit)
    for path in bundle.rglob("*.json"):
        for place in (learned.project, still_life.capture, tmp_path):
            assert "engine" in path.parts or str(place) not in path.read_text(), path.name
    template = read_json(bundle / "template.json", "template")
    paths = [entry["default"] for entry in template["parameterDefinitions"] if entry["type"] == "PATH"]
    assert sorted(paths) == ["edit.json", "engine", "frames", "project"]
    assert all((bundle / path).exists() for path in paths if path != "frames")


def test_moved_bundle_renders_like_the_project(learned, sequence, tmp_path):
    """Of photos, which are packed; cameras are rendered in test_openjd.py."""
    chosen = {"views": "test", "edit": sequence.edit}
    moved = karf.render_bundle(learned.project, tmp_path / "bundle", **chosen).rename(tmp_path / "moved")
    assert Project(moved / "project").splats_file.is_file() and len(names_in(moved / "photos")) == 2
    pictures = []
    for project, out in ((learned.project, tmp_path / "here"), (moved / "project", tmp_path / "there")):
        karf.render(project, out, **chosen, threads=1, device="cpu")
        pictures.append({path.name: path.read_bytes() for path in (out / "recolor").iterdir()})
    assert pictures[0] == pictures[1] and len(pictures[0]) == 2
    cameras = karf.render_bundle(learned.project, tmp_path / "cameras", views=str(sequence.cameras))
    assert not (cameras / "photos").exists()


def test_each_frame_can_have_its_own_edit(learned, sequence, tmp_path):
    edits = tmp_path / "edits"
    for number in range(1, 8):
        sequence.paint(0.1 * number, edits / f"frame_{number:04d}.json")
    views = {"views": str(sequence.cameras)}
    one_each = [edits / f"frame_{number:04d}.json" for number in range(1, 6)]
    for name, given in (("folder", edits), ("list", one_each)):
        bundle = karf.render_bundle(learned.project, tmp_path / name, edit=given, **views)
        assert names_in(bundle / "edits") == [path.name for path in one_each]
    options = views | {"threads": 1, "device": "cpu"}
    karf.render(bundle / "project", tmp_path / "all", edit=bundle / "edits", **options)
    karf.render(bundle / "project", tmp_path / "fourth", edit=one_each[3], first=4, count=1, **options)
    (fourth,) = (tmp_path / "fourth" / "recolor").iterdir()
    assert fourth.read_bytes() == (tmp_path / "all" / "recolor" / fourth.name).read_bytes()
    assert len({path.read_bytes() for path in (tmp_path / "all" / "recolor").iterdir()}) == 5
    with pytest.raises(BadRequest, match="2 edits for 5 views"):
        karf.render(bundle / "project", tmp_path / "all", edit=one_each[:2], **options)
    one_each[2].unlink()
    with pytest.raises(DataError, match="frame_0003"):
        karf.render_bundle(learned.project, tmp_path / "another", edit=edits, **views)


def test_failed_bundle_overwrites_and_leaves_nothing(learned, still_life, tmp_path):
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "note").write_text("mine")
    with pytest.raises(BadRequest, match="and is not empty"):
        karf.render_bundle(learned.project, tmp_path / "taken", views="test")
    (tmp_path / "masks").mkdir()
    with pytest.raises(DataError, match="has no masks"):
        karf.learning_bundle(still_life.capture, tmp_path / "masks", tmp_path / "bundle", views="test")
    write_edit(tmp_path / "edit.json", Edit({"kettle": np.zeros((2, 3), np.float32)}))
    with pytest.raises(DataError, match="kettle"):
        karf.render_bundle(learned.project, tmp_path / "bundle", views="test", edit=tmp_path / "edit.json")
    assert names_in(tmp_path) == ["edit.json", "masks", "taken"] and names_in(tmp_path / "taken") == ["note"]


@pytest.fixture
def film(still_life, learned, tmp_path):
    """A capture, its masks and its project in one folder, beside a secret."""
    (tmp_path / "id_rsa").write_text("secret")
    shutil.copytree(still_life.capture, tmp_path / "pictures")
    for name, source in (("capture", still_life.capture), ("masks", still_life.masks), ("project", learned.project)):
        shutil.copytree(source, tmp_path / "film" / name)
    return tmp_path / "film"


def set_photo(project, photo):
    """Make this the photo of all views of a project."""
    content = json.loads(project.capture_file.read_text())
    for view in content["views"]:
        view["image"], view["image_from_here"] = str(photo), None
    project.capture_file.write_text(json.dumps(content))
    state = project.state()
    state["stages"]["geometry"]["files"]["capture.json"] = checksum(project.capture_file)
    write_state(project.state_file, state)


def test_outside_photos_are_packed_only_from_named_folder(film, tmp_path):
    project, photo = Project(film / "project"), tmp_path / "pictures" / "train" / "r_0.png"
    set_photo(project, project.folder / "secret.png")
    shutil.copy(tmp_path / "id_rsa", project.folder / "secret.png")
    with pytest.raises(DataError, match=r"secret\.png cannot be read"):
        karf.render_bundle(project.folder, tmp_path / "bundle", views="test")
    for outside in (tmp_path / "id_rsa", photo):
        set_photo(project, outside)
        with pytest.raises(BadRequest, match="lies outside of"):
            karf.render_bundle(project.folder, tmp_path / "bundle", views="test")
    assert not (tmp_path / "bundle").exists()
    bundle = karf.render_bundle(project.folder, tmp_path / "bundle", views="test", photos=tmp_path / "pictures")
    assert len(names_in(bundle / "photos")) == 2


def test_outside_links_are_packed_only_from_named_folder(film, tmp_path):
    capture, masks = film / "capture", film / "masks"
    photo, mask = capture / "train" / "r_0.png", next(masks.rglob("*.png"))
    photo.unlink()
    photo.symlink_to(tmp_path / "pictures" / "train" / "r_0.png")
    for name in ("notes.txt", "keys.json"):
        (capture / name).symlink_to(tmp_path / "id_rsa")
    with pytest.raises(BadRequest, match="--photos"):
        karf.learning_bundle(capture, masks, tmp_path / "bundle")
    named = {"photos": tmp_path / "pictures"}
    bundle = karf.learning_bundle(capture, masks, tmp_path / "bundle", **named)
    assert (bundle / "capture" / "train" / "r_0.png").read_bytes() == photo.read_bytes()
    assert not list(bundle.rglob("notes.txt")) and not list(bundle.rglob("keys.json"))
    mask.unlink()
    mask.symlink_to(tmp_path / "id_rsa")
    with pytest.raises(DataError, match="is a link to"):
        karf.learning_bundle(capture, masks, tmp_path / "other", **named)


def test_packed_files_are_listed_before_writing(learned, tmp_path):
    lines = []
    options = FarmOptions.of(source=learned.project, out=tmp_path / "bundle", views="test")

    def emit(kind, /, **values):
        if kind == "stage":
            assert not list(tmp_path.glob("*bundle*"))
            lines.append(values["text"])

    write_bundle(options, emit, lambda: False)
    assert any(str(learned.project / "results") in line for line in lines)
    assert any(line.startswith("packing 2 files") for line in lines)


def test_view_range_renders_like_all_and_must_not_be_empty(sequence, tmp_path):
    sequence.render(tmp_path / "all")
    sequence.render(tmp_path / "part", first=2, last=4, count=2)
    assert names_in(tmp_path / "part" / "recolor") == ["frame_0002.png", "frame_0003.png"]
    for path in (tmp_path / "part" / "recolor").iterdir():
        assert path.read_bytes() == (tmp_path / "all" / "recolor" / path.name).read_bytes()
    for part in ({"first": 6}, {"first": 0}, {"first": 3, "last": 2}, {"count": 0}):
        with pytest.raises(BadRequest, match="There are 5 views"):
            sequence.render(tmp_path / "out", **part)


def test_project_moved_with_its_photos_finds_them(still_life, tmp_path):
    film, elsewhere = tmp_path / "film", tmp_path / "elsewhere"
    capture = shutil.copytree(still_life.capture, film / "capture")
    few = 'geometry.levels=[{"voxels": 8, "iterations": 1, "step": 1.0}]'
    assert main(geometry_command(replace(still_life, capture=capture), film / "project", few)) == 0
    film.rename(elsewhere)
    for view in read_capture(Project(elsewhere / "project")).views:
        assert view.image.is_relative_to(elsewhere / "capture") and view.image.is_file()


def test_verb_and_library_write_the_same_bundle(learned, sequence, tmp_path):
    chosen = {"views": str(sequence.cameras), "per_task": 2, "alpha": True, "format": "exr16"}
    karf.render_bundle(learned.project, tmp_path / "library", size="photo", overrides=["render.edges=field"], **chosen)
    words = ["--out", tmp_path / "verb", "--views", sequence.cameras, "--per-task", 2, "--alpha", "--format", "exr16"]
    assert main(["farm", *map(str, [learned.project, *words, "--set", "render.edges=field"])]) == 0
    library, verb = (read_json(tmp_path / name / "template.json", "template") for name in ("library", "verb"))
    arguments = [job["steps"][0]["script"]["actions"]["onRun"].pop("args") for job in (library, verb)]
    assert sorted(arguments[0]) == sorted(arguments[1])
    assert library == verb
