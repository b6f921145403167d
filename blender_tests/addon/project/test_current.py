"""What was made from what is learned now is told by marks: clocks that go back and copies without times change nothing."""

import os

import pytest

from karf_engine.palettes.compositing import write_planes

from ..prepared import write_current_planes

LATER, EARLIER = 4e9, 1e9


def set_times(folder, seconds):
    """Let all files of a project be of one time."""
    for path in folder.rglob("*"):
        os.utime(path, (seconds, seconds))


@pytest.mark.parametrize("seconds", [LATER, EARLIER])
def test_planes_are_current_until_a_stage_before_them_is_learned_anew(addon, learned, seconds):
    project = addon.folders.project_of(learned)
    set_times(project.folder, seconds)
    assert addon.disk.is_prepared(learned)
    project.finish("recoloring", "fake", files={"recoloring.safetensors": "of another run"})
    os.utime(project.recoloring_file, (EARLIER, EARLIER))
    assert not addon.disk.is_prepared(learned)
    with pytest.raises(addon.engine_api.DataError, match="was made from other palettes"):
        addon.displayed.of(learned).prepared_view()


def test_planes_of_earlier_versions_are_made_again(addon, learned):
    file = addon.disk.planes_file(learned)
    planes = addon.engine_api.read_planes(file)
    write_planes(file, planes)
    assert not addon.disk.is_prepared(learned)
    write_current_planes(addon, learned, planes)
    assert addon.disk.is_prepared(learned)


def test_damaged_planes_are_not_current(addon, learned):
    file = addon.disk.planes_file(learned)
    file.write_bytes(file.read_bytes()[:-100])
    assert not addon.disk.is_prepared(learned)


@pytest.mark.parametrize("stage", ["geometry", "segmentation"])
def test_renderings_and_masks_are_shown_until_their_stages_are_learned_anew(bpy, addon, learned, stage):
    project = addon.folders.project_of(learned)
    project.uncertainty_file.touch()
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    set_times(project.folder, EARLIER)
    finders = addon.disk.rendering_of, addon.disk.rendered_masks, addon.disk.rendered_doubts
    assert all(find(learned) for find in finders)
    set_times(project.folder / "seen", LATER)
    project.finish(stage, "anew")
    assert not any(find(learned) for find in finders)


def test_renderings_of_what_was_learned_before_are_removed_and_nothing_else(bpy, addon, learned, tmp_path):
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    before = addon.disk.renderings_folder(learned)
    others = [before.with_name("notes"), before.with_name("0123456789abcdef")]
    (tmp_path / "films").mkdir()
    others[0].mkdir()
    others[1].symlink_to(tmp_path / "films", target_is_directory=True)
    addon.folders.project_of(learned).finish("segmentation", "anew")
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    own = addon.disk.renderings_folder(learned)
    assert own != before and set(before.parent.iterdir()) == {own, *others} and (tmp_path / "films").is_dir()
