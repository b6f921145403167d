"""The panels draw in every state of a project, name only what exists, and write nothing."""

from types import SimpleNamespace

import numpy as np
import pytest

from ..layout import Layout
from ..surface.splat_objects import make

VIEW, IMAGE = "VIEW_3D", "IMAGE_EDITOR"


@pytest.fixture
def draw(bpy, addon):
    def draw_all(editor=VIEW, *others):
        """What the sidebar of an editor draws, beside others on the screen whose sidebars are open."""
        drawn = []
        areas = [area(each) for each in (editor, *others)]
        context = SimpleNamespace(
            scene=bpy.context.scene,
            window_manager=bpy.context.window_manager,
            area=areas[0],
            screen=SimpleNamespace(areas=areas),
        )
        addon.sidebar.draw_steps(Layout(bpy, drawn), context)
        return drawn

    return draw_all


def area(editor, has_sidebar=True):
    space = SimpleNamespace(show_region_ui=has_sidebar)
    return SimpleNamespace(type=editor, spaces=SimpleNamespace(active=space))


def test_an_empty_file_offers_the_import(draw):
    drawn = draw()
    assert "karf.import_capture" in drawn
    assert "color" not in drawn and "karf.cancel" not in drawn


def test_without_an_engine_the_first_open_step_leads_to_one(bpy, addon, draw, capture_folder, tmp_path, monkeypatch):
    assert "preferences.addon_show" not in draw()
    monkeypatch.delenv("KARF_ENGINE_PYTHON")
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    drawn = draw()
    assert drawn.count("preferences.addon_show") == 1 and "engine yet" in " ".join(drawn)
    assert drawn.index("preferences.addon_show") < drawn.index("karf.import_capture")
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    drawn = draw()
    assert drawn.count("preferences.addon_show") == 1
    assert drawn.index("karf.import_capture") < drawn.index("preferences.addon_show") < drawn.index("karf.learn_scene")


def test_an_installation_shows_in_the_sidebar_too(addon, draw, monkeypatch):
    at_work = SimpleNamespace(progress=SimpleNamespace(fraction=0.4, title="Installing torch"))
    monkeypatch.setattr(addon.session.get(addon.installing._State), "work", at_work)
    assert "Engine: Installing torch" in draw()


def test_a_learned_scene_shows_its_swatches_without_the_frozen_black(addon, learned, draw):
    drawn = draw()
    assert drawn.count("color") == 4  # two objects of two colors
    assert drawn.count("karf.reset_swatch") == 6  # one a swatch, in its learned color, and one an object
    assert drawn.count("KARF_MT_swatch") == 4 and drawn.count("KARF_MT_palette") == 2
    assert "karf.becomes" not in drawn and "karf.match_picture" not in drawn
    learned.karf.objects["pot"].show_becomes = learned.karf.match.show = True
    drawn = draw()
    assert drawn.count("karf.becomes") == drawn.count("karf.match_picture") == 1


def test_the_view_to_mark_next_and_what_is_unsure_are_in_the_panel(addon, learned, draw):
    report = {"suggestions": {"photo_2": 0.2}, "unsure": {"pot": {"share": 0.25, "unseen": 0.9}}}
    project = addon.folders.project_of(learned)
    project.finish("segmentation", "s")
    addon.engine_api.write_json(project.segmentation_report, report)
    shown = draw()
    assert "Mark next: photo_2" in shown and "All views would help about equally" not in shown
    assert "pot: 25 % unsure, not visible in any marked view" in " ".join(shown)  # in lines of the panel's width
    addon.engine_api.write_json(project.segmentation_report, report | {"any_view_helps": True})
    shown = draw()
    assert "Mark next: photo_2" in shown and "All views would help about equally" in shown


def test_the_button_of_splat_objects_is_there_where_one_is_active_or_follows(bpy, addon, learned, draw):
    assert "karf.follow_splat" not in draw()
    item = make(bpy, "kiri", 1)
    assert draw().count("karf.follow_splat") == 1
    bpy.context.view_layer.objects.active = None
    assert "karf.follow_splat" not in draw()
    learned.karf.surface.splat = item
    assert draw().count("karf.follow_splat") == 1
    bpy.context.scene.collection.objects.unlink(item)
    assert "karf.follow_splat" not in draw()


def test_a_merged_swatch_is_not_shown_but_its_learned_color_is(addon, learned, draw):
    addon.steps.merge_swatch(learned, "pot", 2, 1)
    drawn = draw()
    assert drawn.count("color") == 3 and drawn.count("karf.reset_swatch") == 6


def test_surfaces_of_the_swatches_that_are_shown_are_drawn_where_they_are_unfolded(addon, learned, draw):
    assert "gloss" not in draw()
    learned.karf.objects["pot"].show_surface = True
    swatches = len(learned.karf.objects["pot"].swatches) - 1
    assert [draw().count(name) for name in (*addon.colors.SURFACE, "karf.reset_surface")] == [swatches] * 4
    addon.steps.merge_swatch(learned, "pot", 2, 1)
    assert draw().count("gloss") == swatches - 1


def test_the_menus_of_a_swatch_offer_what_can_be_done(bpy, addon, learned):
    def drawn(name, index=1):
        entries, item = [], learned.karf.objects["pot"]
        context = SimpleNamespace(scene=learned, karf_object=item, karf_swatch=item.swatches[index])
        getattr(addon.swatching, name).draw(SimpleNamespace(layout=Layout(bpy, entries)), context)
        return entries

    offered = drawn("KARF_MT_swatch")
    assert {"locked", "karf.copy_swatch", "karf.paste_swatch", "KARF_MT_swap", "KARF_MT_link", "KARF_MT_merge"} <= set(
        offered
    )
    assert "karf.unlink_swatch" not in offered and "karf.split_swatch" not in offered
    assert [entry for entry in drawn("KARF_MT_swap") if " " in entry] == ["lid 1", "lid 2", "pot 2"]
    assert [entry for entry in drawn("KARF_MT_merge") if " " in entry] == ["pot 2"]
    assert "karf.paste_swatch" in drawn("KARF_MT_palette")
    addon.steps.link_swatches(learned, ("pot", 1), ("lid", 1))
    addon.steps.merge_swatch(learned, "pot", 2, 1)
    assert {"karf.unlink_swatch", "karf.split_swatch"} <= set(drawn("KARF_MT_swatch"))


def test_the_right_button_on_a_field_offers_the_swatchs_menu(bpy, addon, learned):
    def offered(pointer):
        entries, context = [], SimpleNamespace(scene=learned, button_pointer=pointer)
        addon.swatching.draw_context_menu(SimpleNamespace(layout=Layout(bpy, entries)), context)
        return entries

    assert offered(learned.karf.objects["lid"].swatches[2]) == ["KARF_MT_swatch"]
    assert offered(learned.karf) == offered(None) == []


def test_a_view_without_planes_says_so(learned, draw):
    assert "Show" in draw() and "Prepare" not in draw()
    learned.karf.active_view = "photo_2"
    assert "Prepare" in draw() and "Show" not in draw()


def test_errors_of_sparse_points_are_shown_where_there_are_points(
    bpy, addon, capture_folder, tmp_path, draw, monkeypatch
):
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    assert "There are no sparse points to check the cameras with" in draw()
    bpy.context.scene.karf.n_points = 7
    assert {"show_reprojection", "Look through a view to see its errors"} <= set(draw())
    known = SimpleNamespace(summary=addon.engine_api.ErrorSummary(7, 0.5, 2.25))
    monkeypatch.setattr(addon.reprojection, "of_camera", lambda scene, camera: known)
    assert {"7 points, median error 0.50 px,", "worst 2.25 px"} <= set(draw())


def test_a_running_job_and_a_failed_one_are_shown(bpy, draw):
    progress = bpy.context.window_manager.karf_progress
    progress.running, progress.stage, progress.fraction, progress.text = True, "Learn Scene", 0.5, "50%"
    assert {"Learn Scene", "50%", "karf.cancel"} <= set(draw())
    progress.running, progress.error, progress.hint = False, "photo_7.png is missing.", "Find it."
    progress.warnings = "The lid is dark."
    assert {"Learn Scene failed", "photo_7.png is missing.", "Find it.", "The lid is dark."} <= set(draw())
    bpy.ops.karf.dismiss()
    assert not {"Learn Scene failed", "The lid is dark.", "karf.dismiss"} & set(draw())


@pytest.fixture
def draw_dialog(bpy, addon):
    def draw(name):
        drawn = []
        operator = SimpleNamespace(layout=Layout(bpy, drawn), bl_rna=getattr(bpy.ops.karf, name).get_rna_type())
        kind = next(each for each in vars(addon.render).values() if getattr(each, "bl_idname", "") == f"karf.{name}")
        bound = {each: getattr(kind, each).__get__(operator) for each in ("draw", "draw_what")}
        vars(operator).update(bound)
        operator.draw(bpy.context)
        return drawn

    return draw


def test_the_dialog_of_frames_asks_with_blenders_own_names(learned, draw_dialog):
    drawn = draw_dialog("render_camera")
    assert {"camera", "resolution_x", "frame_start", "frame_end", "frame_step", "file_format", "out"} <= set(drawn)


def test_a_format_offers_the_depths_that_it_has(learned, draw_dialog):
    karf = learned.karf
    assert draw_dialog("render_camera").count("color_depth") == 2 and karf.color_depth == "8"
    karf.file_format = "OPEN_EXR"
    assert karf.color_depth == "16"
    karf.color_depth, karf.file_format = "32", "PNG"
    assert karf.color_depth == "16"


def test_a_long_side_is_asked_for_where_it_is_chosen(learned, draw_dialog):
    drawn = draw_dialog("render_capture")
    assert {"split", "captured_size"} <= set(drawn) and "captured_pixels" not in drawn
    learned.karf.captured_size = "PIXELS"
    assert "captured_pixels" in draw_dialog("render_capture")


# what the steps draw that belongs to the picture, and what does not
OF_THE_PICTURE = {
    "KARF_UL_objects",
    "karf.mark",
    "color",
    "KARF_MT_swatch",
    "karf.keep_look",
    "karf.show_masks",
    "mode",
}
OF_THE_SCENE = {"karf.import_capture", "karf.learn_all", "karf.segment", "karf.extract_palette", "karf.render_camera"}


def test_nothing_stands_twice_side_by_side(addon, learned, draw):
    addon.folders.project_of(learned).finish("segmentation", "s")
    left, right = draw(VIEW, IMAGE), draw(IMAGE, VIEW)
    of_both = {each for each in {*left} & {*right} if "." in each or each.startswith("KARF_")}
    assert of_both == {"karf.open_manual"}
    assert {*left} >= OF_THE_SCENE and not {*left} & OF_THE_PICTURE
    assert {*right} >= OF_THE_PICTURE and not {*right} & OF_THE_SCENE
    assert "No job is running" in left and "No job is running" not in right


@pytest.mark.parametrize("editor", [VIEW, IMAGE])
def test_an_editor_that_is_alone_has_all_steps(learned, draw, editor):
    assert {*draw(editor)} >= OF_THE_SCENE | OF_THE_PICTURE


def test_an_editor_whose_neighbor_has_put_its_sidebar_away_has_all_steps(addon, learned):
    screen = SimpleNamespace(areas=[area(VIEW), area(IMAGE, has_sidebar=False)])
    assert addon.sidebar.is_displayed_here(SimpleNamespace(area=screen.areas[0], screen=screen), IMAGE)
    screen.areas[1].spaces.active.show_region_ui = True
    assert not addon.sidebar.is_displayed_here(SimpleNamespace(area=screen.areas[0], screen=screen), IMAGE)


def test_the_3d_view_says_where_the_steps_are_that_it_has_not(learned, draw):
    assert draw(VIEW, IMAGE).count("Image Editor") == 2
    assert "Image Editor" not in draw(VIEW)


def test_where_files_were_written_the_status_opens_their_folder(bpy, addon, learned, draw, tmp_path):
    buttons = draw().count("karf.open_folder")
    addon.progress.wrote(tmp_path)
    assert draw().count("karf.open_folder") == buttons + 1
    bpy.ops.karf.dismiss()
    assert draw().count("karf.open_folder") == buttons


def test_every_step_opens_its_page_of_the_manual(bpy, addon):
    for section in addon.sidebar.SECTIONS:
        assert bpy.ops.karf.open_manual(page=section.page) == {"FINISHED"}
        text = bpy.data.texts["KaRF manual"].as_string()
        assert text.startswith("# ") and not [each for each in ("![", "**", "](") if each in text]


def test_the_manual_has_all_pages_of_tasks(bpy, addon):
    pages = bpy.ops.karf.open_manual.get_rna_type().properties["page"].enum_items.keys()
    assert sorted(pages) == sorted(file.stem for file in addon.project.MANUAL.glob("*.md"))


def test_both_editors_have_the_panel(bpy, addon):
    panels = addon.sidebar.StepsPanel.__subclasses__()
    assert {panel.bl_space_type for panel in panels} == {"VIEW_3D", "IMAGE_EDITOR"}
    assert all(hasattr(bpy.types, panel.__name__) for panel in panels)


def test_no_panel_pulls_its_tab_before_those_of_blender(addon):
    """Blender puts panels without a header before all others, and tabs stand in the order of their first panels."""
    assert not [
        panel
        for panel in addon.sidebar.StepsPanel.__subclasses__()
        if "HIDE_HEADER" in getattr(panel, "bl_options", ())
    ]


def test_the_status_has_as_many_rows_whatever_it_says(bpy, addon):
    """So that no button below it moves while a job runs or when it ends."""

    class Rows(Layout):
        count = 0

        def row(self, **_):
            Rows.count += 1
            return Layout(bpy, [])

        def column(self, **_):
            return self

        def label(self, **_):
            Rows.count += 1

    def rows():
        Rows.count = 0
        addon.sidebar.draw_status(Rows(bpy, []), bpy.context)
        return Rows.count

    progress = bpy.context.window_manager.karf_progress
    counts = {"idle": rows()}
    progress.running = True
    counts["running"] = rows()
    progress.running, progress.error, progress.warnings = False, "photo_7.png is missing.", "One.\nTwo."
    counts["failed"] = rows()
    assert set(counts.values()) == {2}


def test_a_greyed_out_step_says_why(bpy, addon, scene):
    for name in ("learn_scene", "segment", "extract_palette", "show_view", "render_view", "becomes", "cancel"):
        with pytest.raises(RuntimeError, match=r"Import a capture|Extract the palettes|No job"):
            getattr(bpy.ops.karf, name)()


def test_a_step_waits_for_the_one_before_it(bpy, addon, capture_folder, tmp_path):
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    for name, reason in (("segment", "Learn the scene first"), ("extract_palette", "Segment the objects first")):
        with pytest.raises(RuntimeError, match=reason):
            getattr(bpy.ops.karf, name)()
    addon.steps.learn_scene(bpy.context.scene).wait()
    with pytest.raises(RuntimeError, match="Mark an object first"):
        bpy.ops.karf.segment()
    bpy.context.scene.karf.masks = str(tmp_path)
    assert bpy.ops.karf.segment.poll()


def test_a_learned_color_is_drawn_as_an_icon_of_it(addon):
    tints = addon.tints
    tints.icon((1.0, 0.25, 0.0))
    pixels = addon.session.get(tints.ColorIcons).icons["#ff4000"].icon_pixels_float[:]
    np.testing.assert_allclose(np.reshape(pixels, (-1, 4)), [[1, 0.25, 0, 1]] * tints.ICON_SIDE**2, atol=1 / 255)


def test_what_is_looked_at_and_what_is_left_are_in_the_panel(bpy, addon, learned, draw):
    seeing = bpy.context.window_manager.karf_seeing
    assert draw().count("karf.solo_swatch") == 6 and "karf.see_view" not in draw()
    seeing.mode = "LEARNED"
    assert "karf.see_view" in draw()
    seeing.mode = "EDITED"
    bpy.ops.karf.show_masks()
    assert {"tint", "lid", "pot"} <= set(draw())
    learned.karf.active_view = "photo_2"
    assert "Press Show Masks for this view" in draw()
    seeing.show_masks = False
    pot = learned.karf.objects["pot"]
    pot.show_becomes = True
    pot.source, pot.target = (0.8, 0.2, 0.1), (0.1, 0.3, 0.8)
    left = addon.displayed.of(learned).left_to_target(pot)
    assert f"Remaining difference: visible ({left:.1f})" in draw()
    bpy.ops.karf.becomes(object_name="pot")
    assert "Remaining difference: invisible" in " ".join(draw())


def test_the_words_of_the_field_are_under_advanced(bpy, addon, learned, draw, monkeypatch):
    report = {"unsure": {"pot": {"share": 0.4, "unseen": 0.9}}}
    project = addon.folders.project_of(learned)
    project.finish("segmentation", "s")
    addon.engine_api.write_json(project.segmentation_report, report)
    learned.karf.match.show = learned.karf.objects["pot"].show_becomes = True
    left = learned.karf.match.left.add()
    left.name, left.before, left.left = "pot", 9.0, 2.0
    drawn = draw()
    assert drawn.count("Advanced") == 6
    for button, name in (("karf.import_capture", "photo_space"), ("karf.learn_all", "nerf")):
        after = drawn.index(button)
        assert after < drawn.index("Advanced", after) < drawn.index(name)
    assert "pot: the remaining difference is visible side by side (2.0, was 9.0)" in drawn
    assert "CIEDE2000" not in " ".join(drawn)
    monkeypatch.setattr(Layout, "panel", lambda self, *_, **__: (self.row(), None))  # folded, as they are at first
    drawn = draw()
    assert not {"nerf", "compositing", "karf.farm_bundle", "show_reprojection"} & {*drawn}
    assert "unsure" not in " ".join(drawn)


def test_apply_stays_in_its_place_whatever_the_colors_are(bpy, addon, learned, draw):
    pot, places = learned.karf.objects["pot"], set()
    pot.show_becomes = True
    for source, target in (((0.8, 0.2, 0.1),) * 2, ((0.8, 0.2, 0.1), (0.1, 0.3, 0.8)), ((0, 1, 0), (0.1, 0.3, 0.8))):
        pot.source, pot.target = source, target
        places.add(draw().index("karf.becomes"))
    assert len(places) == 1
    assert "pot has no such color: pick one on it" in draw()


def test_the_keys_of_before_and_after_are_in_the_image_editors_key_map_and_leave_with_the_extension(bpy, addon):
    keymap = bpy.context.window_manager.keyconfigs.addon.keymaps["Image"]

    def keys():
        return {(item.idname, item.type, item.alt) for item in keymap.keymap_items}

    wanted = {("karf.before_after", "C", False), ("karf.seeing_pie", "C", True)}
    assert wanted <= keys()
    addon.extension.unregister()
    assert not wanted & keys()
    addon.extension.register()
    assert wanted <= keys()
