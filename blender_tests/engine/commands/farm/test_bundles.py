"""Bundles: all that a job reads, with paths that lead from one file of the bundle to another."""

import json
import shutil

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine as karf
from blender_tests.engine.commands.farm.sequences import write_sequence
from blender_tests.engine.conftest import run_engine
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
    return write_sequence(learned.project, tmp_path, 5)


def texts(bundle):
    """All JSON of a bundle but the engine's."""
    return {path.name: path.read_text() for path in bundle.rglob("*.json") if "engine" not in path.parts}


def test_no_path_of_a_bundle_leads_out_of_it(learned, still_life, sequence, tmp_path):
    bundle = karf.render_bundle(learned.project, tmp_path / "bundle", views="all", edit=sequence.edit)
    for name, text in texts(bundle).items():
        for place in (learned.project, still_life.capture, tmp_path):
            assert str(place) not in text, name
    template = read_json(bundle / "template.json", "template")
    paths = [entry["default"] for entry in template["parameterDefinitions"] if entry["type"] == "PATH"]
    assert sorted(paths) == ["edit.json", "engine", "frames", "project"]
    assert all((bundle / path).exists() for path in paths if path != "frames")


def test_the_project_of_a_bundle_renders_captured_photos_wherever_it_lies(learned, sequence, tmp_path):
    bundle = karf.render_bundle(learned.project, tmp_path / "bundle", views="test", edit=sequence.edit)
    moved = bundle.rename(tmp_path / "moved")
    for project, out in ((learned.project, "here"), (moved / "project", "there")):
        karf.render(project, tmp_path / out, views="test", edit=sequence.edit, threads=1, device="cpu")
    here = {path.name: path.read_bytes() for path in (tmp_path / "here" / "recolor").iterdir()}
    assert here == {path.name: path.read_bytes() for path in (tmp_path / "there" / "recolor").iterdir()}
    assert len(here) == 2


def test_photos_are_taken_along_only_where_they_are_recolored(learned, sequence, tmp_path):
    cameras = karf.render_bundle(learned.project, tmp_path / "cameras", views=str(sequence.cameras))
    photos = karf.render_bundle(learned.project, tmp_path / "photos", views="test")
    assert not (cameras / "photos").exists()
    assert len(list((photos / "photos").iterdir())) == 2


def test_each_frame_may_have_an_edit_of_its_own(learned, sequence, tmp_path):
    edits = [tmp_path / f"edit_{number}.json" for number in range(5)]
    palettes = karf.load(learned.project, device="cpu").palettes
    for number, path in enumerate(edits):
        colors = {palette.name: palette.colors.copy() for palette in palettes}
        colors["ball"][1] = 0.1 * number
        write_edit(path, Edit(colors))
    bundle = karf.render_bundle(learned.project, tmp_path / "bundle", views=str(sequence.cameras), edit=edits)
    views = {"views": str(sequence.cameras), "threads": 1, "device": "cpu"}
    karf.render(bundle / "project", tmp_path / "all", edit=bundle / "edits", **views)
    karf.render(bundle / "project", tmp_path / "fourth", edit=edits[3], first=4, count=1, **views)
    (fourth,) = (tmp_path / "fourth" / "recolor").iterdir()
    assert fourth.read_bytes() == (tmp_path / "all" / "recolor" / fourth.name).read_bytes()
    assert len({path.read_bytes() for path in (tmp_path / "all" / "recolor").iterdir()}) == 5


def test_a_folder_of_edits_is_taken_along_for_the_views_that_are_rendered(learned, sequence, tmp_path):
    (tmp_path / "edits").mkdir()
    for number in range(1, 8):
        shutil.copy(sequence.edit, tmp_path / "edits" / f"frame_{number:04d}.json")
    views = {"views": str(sequence.cameras), "edit": tmp_path / "edits"}
    bundle = karf.render_bundle(learned.project, tmp_path / "bundle", **views)
    assert sorted(path.stem for path in (bundle / "edits").iterdir()) == [f"frame_{n:04d}" for n in range(1, 6)]
    (tmp_path / "edits" / "frame_0003.json").unlink()
    with pytest.raises(DataError, match="frame_0003"):
        karf.render_bundle(learned.project, tmp_path / "another", **views)


def test_a_bundle_is_never_written_over(learned, tmp_path):
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "note").write_text("mine")
    with pytest.raises(BadRequest, match="and is not empty"):
        karf.render_bundle(learned.project, tmp_path / "taken", views="test")
    assert [path.name for path in (tmp_path / "taken").iterdir()] == ["note"]


def test_where_something_is_missing_nothing_is_left_of_the_bundle(still_life, tmp_path):
    (tmp_path / "masks").mkdir()
    with pytest.raises(DataError, match="has no masks"):
        karf.learning_bundle(still_life.capture, tmp_path / "masks", tmp_path / "bundle", views="test")
    assert [path.name for path in tmp_path.iterdir()] == ["masks"]


def test_an_edit_of_another_project_is_refused_before_it_gets_to_the_farm(learned, tmp_path):
    write_edit(tmp_path / "edit.json", Edit({"kettle": np.zeros((2, 3), np.float32)}))
    with pytest.raises(DataError, match="kettle"):
        karf.render_bundle(learned.project, tmp_path / "bundle", views="test", edit=tmp_path / "edit.json")


def test_photos_outside_the_captures_folder_are_refused(still_life, tmp_path):
    capture = shutil.copytree(still_life.capture, tmp_path / "capture")
    (capture / "train").rename(tmp_path / "train")
    text = (capture / "transforms_train.json").read_text()
    (capture / "transforms_train.json").write_text(text.replace("./train", str(tmp_path / "train")))
    with pytest.raises(BadRequest, match="lies outside"):
        karf.learning_bundle(capture, still_life.masks, tmp_path / "bundle")


def linked(place, target):
    place.unlink()
    place.symlink_to(target)


@pytest.fixture
def film(still_life, learned, tmp_path):
    """A capture and its project in one folder, beside what nobody wants to send away."""
    (tmp_path / "id_rsa").write_text("secret")
    shutil.copytree(still_life.capture, tmp_path / "film" / "capture")
    shutil.copytree(still_life.masks, tmp_path / "film" / "masks")
    project = Project(shutil.copytree(learned.project, tmp_path / "film" / "project"))
    shutil.copytree(still_life.capture, tmp_path / "pictures")
    return tmp_path / "film", project


def with_photo(project, photo):
    """Let the project say that this is the photo of its test views."""
    content = json.loads(project.capture_file.read_text())
    for view in content["views"]:
        view["image"], view["image_from_here"] = str(photo), None
    project.capture_file.write_text(json.dumps(content))
    state = project.state()
    state["stages"]["geometry"]["files"]["capture.json"] = checksum(project.capture_file)
    write_state(project.state_file, state)


def test_a_photo_that_is_not_a_picture_or_lies_elsewhere_is_never_packed(film, tmp_path):
    _, project = film
    for photo in (tmp_path / "id_rsa", tmp_path / "pictures" / "train" / "r_0.png"):
        with_photo(project, photo)
        with pytest.raises(BadRequest, match="lies outside of"):
            karf.render_bundle(project.folder, tmp_path / "bundle", views="test")
    with_photo(project, project.folder / "secret.png")
    shutil.copy(tmp_path / "id_rsa", project.folder / "secret.png")
    with pytest.raises(DataError, match=r"secret\.png cannot be read"):
        karf.render_bundle(project.folder, tmp_path / "bundle", views="test")
    assert not (tmp_path / "bundle").exists()


def test_a_place_that_the_user_names_is_packed_too(film, tmp_path):
    _, project = film
    with_photo(project, tmp_path / "pictures" / "train" / "r_0.png")
    bundle = karf.render_bundle(project.folder, tmp_path / "bundle", views="test", photos=tmp_path / "pictures")
    assert len(list((bundle / "photos").iterdir())) == 2


def test_links_of_a_capture_that_lead_out_are_packed_only_where_the_user_named_their_place(film, tmp_path):
    folder, _ = film
    photo = folder / "capture" / "train" / "r_0.png"
    linked(photo, tmp_path / "pictures" / "train" / "r_0.png")
    (folder / "capture" / "notes.txt").symlink_to(tmp_path / "id_rsa")
    (folder / "capture" / "keys.json").symlink_to(tmp_path / "id_rsa")
    with pytest.raises(BadRequest, match="--photos"):
        karf.learning_bundle(folder / "capture", folder / "masks", tmp_path / "bundle")
    named = {"photos": tmp_path / "pictures"}
    bundle = karf.learning_bundle(folder / "capture", folder / "masks", tmp_path / "bundle", **named)
    assert (bundle / "capture" / "train" / "r_0.png").read_bytes() == photo.read_bytes()
    assert not list(bundle.rglob("notes.txt")) and not list(bundle.rglob("keys.json"))
    linked(next((folder / "masks").rglob("*.png")), tmp_path / "id_rsa")
    with pytest.raises(DataError, match="is a link to"):
        karf.learning_bundle(folder / "capture", folder / "masks", tmp_path / "other", **named)


def test_what_is_packed_is_listed_before_anything_is_written(film, tmp_path):
    _, project = film
    lines = []
    options = FarmOptions.of(source=project.folder, out=tmp_path / "bundle", views="test")

    def emit(kind, /, **values):
        if kind == "stage":
            assert not list(tmp_path.glob("*bundle*"))
            lines.append(values["text"])

    write_bundle(options, emit, lambda: False)
    assert any(str(project.folder / "results") in line for line in lines)
    assert any(line.startswith("packing 2 files") for line in lines)


def test_a_part_of_the_views_is_rendered_as_it_is_among_all(sequence, tmp_path):
    sequence.render(tmp_path / "all")
    sequence.render(tmp_path / "part", first=2, last=4, count=2)
    part = sorted((tmp_path / "part" / "recolor").iterdir())
    assert [path.stem for path in part] == ["frame_0002", "frame_0003"]
    for path in part:
        assert path.read_bytes() == (tmp_path / "all" / "recolor" / path.name).read_bytes()


@pytest.mark.parametrize("part", [{"first": 6}, {"first": 0}, {"first": 3, "last": 2}, {"count": 0}])
def test_a_part_that_is_empty_is_refused(sequence, tmp_path, part):
    with pytest.raises(BadRequest, match="There are 5 views"):
        sequence.render(tmp_path / "out", **part)


def test_a_project_that_moves_with_its_photos_still_finds_them(still_life, tmp_path):
    capture = shutil.copytree(still_life.capture, tmp_path / "film" / "capture")
    project = tmp_path / "film" / "project"
    command = still_life.command(project, 'geometry.levels=[{"voxels": 8, "iterations": 1, "step": 1.0}]')
    masks = command.index("--masks")
    done = run_engine("geometry", str(capture), *command[2:masks], *command[masks + 2 :])
    assert done.returncode == 0, done.stderr
    (tmp_path / "film").rename(tmp_path / "elsewhere")
    views = read_capture(Project(tmp_path / "elsewhere" / "project")).views
    assert all(view.image.is_relative_to(tmp_path / "elsewhere" / "capture") for view in views)
    assert all(view.image.is_file() for view in views)


def test_the_verb_writes_the_same_bundle_as_the_library(learned, sequence, tmp_path):
    chosen = {"views": str(sequence.cameras), "per_task": 2, "alpha": True, "format": "exr16"}
    karf.render_bundle(learned.project, tmp_path / "library", size="photo", overrides=["render.edges=field"], **chosen)
    done = run_engine(
        *("farm", learned.project, "--out", tmp_path / "verb", "--views", sequence.cameras, "--per-task", 2),
        *("--alpha", "--format", "exr16", "--set", "render.edges=field"),
    )
    assert done.returncode == 0, done.stderr
    library, verb = (read_json(tmp_path / name / "template.json", "template") for name in ("library", "verb"))
    arguments = [job["steps"][0]["script"]["actions"]["onRun"].pop("args") for job in (library, verb)]
    assert sorted(arguments[0]) == sorted(arguments[1])
    assert library == verb
