"""Steps as scripts call them: names and arguments that scripts already use, and a scene that need not be given."""

import inspect

import pytest

ARGUMENTS = {
    "add_color": "object_name picked color reach protect",
    "add_strip": "folder",
    "apply_edit": "edit",
    "becomes": "object_name source target rule from_edited",
    "build_compositor": "view layers driven",
    "colorways": "sheet views out predict_only",
    "export_cameras": "path camera frames",
    "export_scene": "path shape",
    "extract_palette": "",
    "farm_bundle": "camera frames out per_task python",
    "find_poses": "photos rig",
    "import_cameras": "path",
    "import_capture": "path project holdout rig",
    "learn_all": "preset overrides",
    "learn_scene": "preset overrides nerf",
    "learn_splats": "",
    "link_swatches": "one other",
    "match_picture": "picture view",
    "merge_swatch": "object_name index into",
    "prepare_views": "views",
    "preview_camera": "path camera long_side",
    "protect_neutrals": "object_name index",
    "remove_color": "object_name index",
    "render_captured": "views out skip_existing size",
    "render_sequence": "camera frames out skip_existing",
    "render_view": "size",
    "reprojection_error": "view",
    "save_edit": "path",
    "segment": "masks",
    "set_swatch": "object_name index color",
    "show_frames": "folder is_wanted",
    "show_scene": "count points",
    "show_view": "view",
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_a_step_takes_its_arguments_in_this_order_and_a_scene_by_name(addon, name):
    parameters = inspect.signature(getattr(addon.headless, name)).parameters.values()
    assert [each.name for each in parameters if each.name not in ("scene", "options")] == ARGUMENTS[name].split()
    assert next(each.default for each in parameters if each.name == "scene") is None


def test_every_name_is_there(addon):
    assert all(hasattr(addon.headless, name) for name in addon.headless.__all__)
    assert set(ARGUMENTS) < set(addon.headless.__all__)


def test_a_step_works_on_the_given_scene_or_on_that_of_the_context(bpy, addon, learned, tmp_path):
    other = learned.copy()
    addon.headless.set_swatch("pot", 1, "#00ff00", scene=other)
    addon.headless.set_swatch("pot", 2, "#00ff00", other)
    assert [tuple(other.karf.objects["pot"].swatches[index].color) for index in (1, 2)] == [(0, 1, 0)] * 2
    before = tuple(learned.karf.objects["pot"].swatches[1].color)
    addon.headless.set_swatch("pot", 1, (0.25, 0.5, 0.75))
    assert before != tuple(learned.karf.objects["pot"].swatches[1].color) == (0.25, 0.5, 0.75)


def test_a_task_gives_its_result_and_what_is_done_already_is_given_as_it_is(addon, learned):
    path = addon.headless.render_view()
    assert path.is_file() and path.stem == learned.karf.active_view and path.parent.name == "recolor"
    assert addon.headless.render_view(size="shown").is_file()
