"""The panels draw in every project state, name only what exists, and write nothing."""

from collections import Counter
from operator import attrgetter
from types import SimpleNamespace

import numpy as np
import pytest

from ..layout import Layout
from ..surface.splat_objects import make

VIEW, IMAGE = "VIEW_3D", "IMAGE_EDITOR"
RED, BLUE = (0.8, 0.2, 0.1), (0.1, 0.3, 0.8)
REPORT = {"suggestions": {"photo_2": 0.2}, "unsure": {"pot": {"share": 0.25, "unseen": 0.9}}}


def area(editor, has_sidebar=True):
    space = SimpleNamespace(show_region_ui=has_sidebar)
    return SimpleNamespace(type=editor, spaces=SimpleNamespace(active=space))


class Desk:
    """The open scene: its sidebars as drawn, and actions that change its state."""

    def __init__(self, bpy, addon, monkeypatch, folder):
        self.bpy, self.addon, self.monkeypatch, self.folder = bpy, addon, monkeypatch, folder
        self.seeing, self.progress = bpy.context.window_manager.karf_seeing, bpy.context.window_manager.karf_progress

    @property
    def karf(self):
        return self.bpy.context.scene.karf

    @property
    def pot(self):
        return self.karf.objects["pot"]

    def draw(self, editor=VIEW, *others):
        """Return what an editor's sidebar draws beside other editors with open sidebars."""
        drawn, areas, context = [], [area(each) for each in (editor, *others)], self.bpy.context
        places = {"area": areas[0], "screen": SimpleNamespace(areas=areas)}
        context = SimpleNamespace(scene=context.scene, window_manager=context.window_manager, **places)
        self.addon.sidebar.draw_steps(Layout(self.bpy, drawn), context)
        return drawn

    def set(self, owner, **values):
        for name, value in values.items():
            setattr(owner, name, value)

    def merge(self):
        self.addon.steps.merge_swatch(self.bpy.context.scene, "pot", 2, 1)

    def find_paints(self):
        self.monkeypatch.setattr(self.addon.palettes, "object_paints", self.addon.engine_api.object_paints)
        self.addon.palettes.load_palettes(self.bpy.context.scene, self.addon.colors.palettes(self.bpy.context.scene))

    def segmented(self, **report):
        project = self.addon.folders.project_of(self.bpy.context.scene)
        project.finish("segmentation", "s")
        self.addon.engine_api.write_json(project.segmentation_report, REPORT | report)

    def splats(self, **summary):
        self.addon.folders.project_of(self.bpy.context.scene).finish("splats", "s", **summary)

    def follow_splats(self, is_linked=True):
        self.karf.surface.splat = make(self.bpy, "kiri", 1)
        self.bpy.context.view_layer.objects.active = None
        if not is_linked:
            self.bpy.context.scene.collection.objects.unlink(self.karf.surface.splat)

    def masks(self, view):
        self.bpy.ops.karf.show_masks()
        self.karf.active_view = view

    def errors(self):
        self.karf.n_points = 7
        found = SimpleNamespace(summary=self.addon.engine_api.ErrorSummary(7, 0.5, 2.25))
        self.monkeypatch.setattr(self.addon.reprojection, "of_camera", lambda scene, camera: found)

    def lose_engine(self):
        self.monkeypatch.delenv("KARF_ENGINE_PYTHON")
        self.monkeypatch.setattr(self.addon.engine_api, "ENGINE_FOLDER", self.folder / "karf_engine")

    def install(self):
        at_work = SimpleNamespace(progress=SimpleNamespace(fraction=0.4, title="Installing torch"))
        self.monkeypatch.setattr(self.addon.session.get(self.addon.installing._State), "work", at_work)


@pytest.fixture
def desk(bpy, addon, scene, seeing, monkeypatch, tmp_path):
    addon.preferences.current().advanced.show_edit = True
    yield Desk(bpy, addon, monkeypatch, tmp_path)
    addon.preferences.current().advanced.show_edit = False


def setting(owner, **values):
    return lambda desk: desk.set(attrgetter(owner)(desk), **values)


def dismissed(action):
    return lambda desk: (action(desk), desk.bpy.ops.karf.dismiss())


RUNNING = {"running": True, "stage": "Learn Scene", "fraction": 0.5, "text": "50%"}
DARK, FAR, LONG = "The lid is dark.", "The pot is far.", "The scene's cameras look past the objects on the table."
FAILED = {"stage": "Learn Scene", "error": "a.png is missing.", "hint": "Find it.", "warnings": DARK}
FAILURE = {"Learn Scene failed": 1, "a.png is missing.": 1, "Find it.": 1, DARK: 1}
POINTS = {"show_reprojection": 1, "Look through a view to see its errors": 1}
SURFACE = {"saturation": 2, "brightness": 2, "gloss": 2, "karf.reset_surface": 2}
EMPTY = {"karf.import_capture": 1, "color": 0, "karf.cancel": 0, "preferences.addon_show": 0}
# two objects with two colors each and no black; one reset per swatch and one per object
SWATCHES = {"color": 4, "karf.reset_swatch": 6, "KARF_MT_swatch": 4, "KARF_MT_palette": 2, "karf.solo_swatch": 6}
FOLDED = ("karf.becomes", "karf.match_picture", "karf.follow_splat", "karf.see_view", "gloss", "tint", "Prepare")
LEARN_SPLATS = {"splat_quality": 1, "karf.learn_splats": 1}
DELETE = {"karf.add_delete_box": 1, "karf.delete_inside": 1}
ANY, NEXT = "All views would help about equally", "Mark next: photo_2"
FAIL, WROTE = setting("progress", **FAILED), lambda desk: desk.addon.progress.wrote(desk.folder)
# state: its fixture, the action that leads there, how often each control or text is drawn
STATES = {
    "empty": ("scene", lambda desk: None, EMPTY),
    "no engine": ("scene", Desk.lose_engine, {"preferences.addon_show": 1}),
    "installing": ("scene", Desk.install, {"Engine: Installing torch": 1}),
    "running": ("scene", setting("progress", **RUNNING), {"Learn Scene": 1, "50%": 1, "karf.cancel": 1}),
    "failed": ("scene", FAIL, FAILURE),
    "failed, dismissed": ("scene", dismissed(FAIL), dict.fromkeys([*FAILURE, "karf.dismiss"], 0)),
    "a message": ("scene", setting("progress", warnings=DARK), {DARK: 2}),  # itself, and in what it opens
    "a long message": ("scene", setting("progress", warnings=LONG), {"The scene's cameras look past the…": 1, LONG: 1}),
    "messages": ("scene", setting("progress", warnings=f"{DARK}\n{FAR}"), {f"2: {DARK}": 1, DARK: 1, FAR: 1}),
    "wrote": ("scene", WROTE, {"karf.open_folder": 1}),
    "wrote, dismissed": ("scene", dismissed(WROTE), {"karf.open_folder": 0}),
    "imported": (
        "project_scene",
        lambda desk: None,
        {"There are no sparse points to check the cameras with": 1, "3 photos, all to learn": 1, "KARF_UL_views": 1},
    ),
    "left out": (
        "project_scene",
        lambda desk: setattr(desk.karf.views[0], "is_learned", False),
        {"2 of 3 photos to learn": 1, "karf.leave_out_blurred": 1},
    ),
    "points": ("project_scene", setting("karf", n_points=7), POINTS),
    "errors": ("project_scene", Desk.errors, {"7 points, median error 0.50 px,": 1, "worst 2.25 px": 1}),
    "learned": ("learned", lambda desk: None, SWATCHES | {"Show": 1} | dict.fromkeys(FOLDED, 0)),
    "becomes": ("learned", setting("pot", show_becomes=True), {"karf.becomes": 1}),
    "match": ("learned", setting("karf.match", show=True), {"karf.match_picture": 1}),
    "paints": ("learned", Desk.find_paints, {"scope": 2, "color": 3}),  # the lid has one on white
    "merged": ("learned", Desk.merge, {"color": 3, "karf.reset_swatch": 6}),
    "surface": ("learned", setting("pot", show_surface=True), SURFACE),
    "surface of merged": ("learned", lambda desk: (desk.set(desk.pot, show_surface=True), desk.merge()), {"gloss": 1}),
    "suggested": ("learned", Desk.segmented, {NEXT: 1, ANY: 0, "pot: 25 % unsure, not visible in": 1}),
    "any suggested": ("learned", lambda desk: desk.segmented(any_view_helps=True), {NEXT: 1, ANY: 1}),
    "splats": ("learned", lambda desk: make(desk.bpy, "kiri", 1), {"karf.follow_splat": 1}),
    "no splats": ("learned", lambda desk: None, LEARN_SPLATS | {"karf.add_delete_box": 0, "karf.delete_inside": 0}),
    "none deleted": ("learned", Desk.splats, DELETE | {"karf.restore_splats": 0}),
    "some deleted": ("learned", lambda desk: desk.splats(erased=7), DELETE | {"karf.restore_splats": 1}),
    "sharp": (
        "learned",
        lambda desk: desk.splats(quality="good", reached=["sharp", 0.84]),
        LEARN_SPLATS | {"Good: new views are sharp, like": 1, "photos blurred by 0.8 pixels": 1},
    ),
    "not measured": (
        "learned",
        lambda desk: desk.splats(quality="draft"),
        LEARN_SPLATS | {"Draft: not measured, for no photos": 1},
    ),
    "splats of an earlier version": ("learned", Desk.splats, LEARN_SPLATS),
    "following": ("learned", Desk.follow_splats, {"karf.follow_splat": 1}),
    "following unlinked": ("learned", lambda desk: desk.follow_splats(is_linked=False), {"karf.follow_splat": 0}),
    "not prepared": ("learned", setting("karf", active_view="photo_2"), {"Prepare": 1, "Show": 0}),
    "as learned": ("learned", setting("seeing", mode="LEARNED"), {"karf.see_view": 1}),
    "masks": ("learned", lambda desk: desk.masks("photo_0"), {"tint": 1, "lid": 2, "pot": 2}),
    "no masks": ("learned", lambda desk: desk.masks("photo_2"), {"Press Show Masks for this view": 1}),
}


@pytest.mark.parametrize("state", STATES)
def test_state_draws_these_controls(request, desk, state):
    fixture, do, wanted = STATES[state]
    request.getfixturevalue(fixture)
    buttons = desk.draw().count("karf.open_folder")
    do(desk)
    found = Counter(desk.draw()) - Counter({"karf.open_folder": buttons})
    assert {text: found[text] for text in wanted} == wanted


def test_first_open_step_leads_to_an_engine(addon, scene, desk, capture_folder, tmp_path):
    desk.lose_engine()
    drawn = desk.draw()
    assert "engine yet" in " ".join(drawn)
    assert drawn.index("karf.import_capture") < drawn.index("preferences.addon_show") < drawn.index("karf.mark")
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    drawn = desk.draw()
    assert drawn.index("karf.learn_all") < drawn.index("preferences.addon_show") < drawn.index("karf.learn_scene")


def test_remaining_difference_is_shown_without_moving_the_button(bpy, addon, learned, desk):
    places, pot = set(), desk.pot
    pot.show_becomes = True
    for source, target in ((RED, RED), ((0, 1, 0), BLUE), (RED, BLUE)):
        desk.set(pot, source=source, target=target)
        places.add(desk.draw().index("karf.becomes"))
        assert ("pot has no such color: pick one on it" in desk.draw()) == (source == (0, 1, 0))
    assert len(places) == 1
    assert "Remaining difference: visible" in desk.draw()
    bpy.ops.karf.becomes(object_name="pot")
    assert "Remaining difference: invisible" in " ".join(desk.draw())


# --- a first recolor -------------------------------------------------------------------------------------------------
MOST_CONTROLS = 20
JARGON = "PSNR dB Splat Segment Volume Reach Unseen Over Scene Colorway NeRF CIEDE2000 unsure numba pycolmap".split()


class Folded(Layout):
    """Everything as a new user sees it."""

    opens_advanced = False

    def panel(self, name, default_closed=False):
        return self.row(), None if default_closed else self.row()


@pytest.fixture
def first(bpy, addon, learned, desk, monkeypatch):
    """Draw the body of each step, or of one, as a new user sees it: one object is marked and learned."""
    learned.karf.objects.remove(learned.karf.objects.find("lid"))
    addon.preferences.current().advanced.show_edit = False
    desk.segmented()

    def draw(*names):
        screen = SimpleNamespace(areas=[area(IMAGE)])
        context = SimpleNamespace(scene=learned, window_manager=bpy.context.window_manager, screen=screen)
        drawn = []
        layout = Folded(bpy, drawn)
        for section in addon.sidebar.SECTIONS:
            if not names or section.name in names:
                section.draw(layout, context)
        return drawn, layout.controls

    return draw


def test_a_first_recolor_shows_at_most_twenty_controls(addon, first, monkeypatch):
    """The strip of an object's swatches is one list; folds and help in headers are not counted."""
    monkeypatch.setattr(addon.swatching, "_draw_swatch", lambda column, *_: column.controls.append("a swatch"))
    _, controls = first()
    assert len([name for name in controls if name != "a swatch"]) + 1 <= MOST_CONTROLS
    assert {"Import Capture", "Mark in Photo", "Learn All", "a swatch", "This View", "Captured Views"} <= {*controls}


def test_technical_terms_are_only_under_advanced(learned, desk, first):
    learned.karf.match.show = desk.pot.show_becomes = True
    desk.set(learned.karf.match.left.add(), name="pot", before=9.0, left=2.0)
    drawn, controls = first()
    text = " ".join(drawn + controls)
    assert not [word for word in JARGON if word in text]
    drawn = desk.draw()
    assert drawn.count("Advanced") == 5
    for button, name in (("karf.import_capture", "photo_space"), ("karf.learn_all", "nerf")):
        after = drawn.index(button)
        assert after < drawn.index("Advanced", after) < drawn.index(name)
    assert "pot: the remaining difference is slight (2.0, was 9.0)" in drawn


def test_open_advanced_controls_are_remembered_per_user(bpy, addon, desk):
    bpy.context.preferences.is_dirty = False
    addon.preferences.current().advanced.show_learn = True
    assert bpy.context.preferences.is_dirty
    addon.preferences.current().advanced.show_learn = False


def poor(desk):
    desk.karf.advice, desk.karf.is_poor = "More photos are needed.", True


@pytest.mark.parametrize(
    "change",
    [
        *(setting("karf", preset=name) for name in ("fast", "fine", "quality", "paper")),
        setting("karf", active_view="photo_2"),
        setting("karf.marking", correct=True),
        setting("karf", nerf="other.tar"),
        poor,
        Desk.lose_engine,
        Desk.install,
    ],
)
def test_no_state_moves_a_button(addon, first, desk, change, monkeypatch):
    """Texts that come and go stand below a step's buttons."""
    monkeypatch.setattr(addon.estimates, "seconds", lambda preset, *_, **__: {"demo": None}.get(preset, 600.0))

    def rows():
        drawn = {name: first(name)[0] for name in addon.states.STEPS}
        return {
            name: [each.index(button) for button in each if button.startswith("karf.")] for name, each in drawn.items()
        }

    before = rows()
    change(desk)
    after = rows()
    assert {name: each[: len(before[name])] for name, each in after.items()} == before


# --- menus and dialogs -----------------------------------------------------------------------------------------------
def test_swatch_menus_offer_possible_actions_also_on_right_click(bpy, addon, learned, desk):
    def entries(draw, **context):
        found = []
        draw(SimpleNamespace(layout=Layout(bpy, found)), SimpleNamespace(scene=learned, **context))
        return found

    def drawn(name):
        return entries(getattr(addon.swatching, name).draw, karf_object=desk.pot, karf_swatch=desk.pot.swatches[1])

    always = {"locked", "karf.copy_swatch", "karf.paste_swatch", "KARF_MT_swap", "KARF_MT_link", "KARF_MT_merge"}
    grouped = {"karf.unlink_swatch", "karf.split_swatch"}
    assert always | {"pot 1"} <= {*drawn("KARF_MT_swatch")} and not grouped & {*drawn("KARF_MT_swatch")}
    assert [entry for entry in drawn("KARF_MT_swap") if " " in entry] == ["lid 1", "lid 2", "pot 2"]
    assert [entry for entry in drawn("KARF_MT_merge") if " " in entry] == ["pot 2"]
    assert "karf.paste_swatch" in drawn("KARF_MT_palette")
    addon.steps.link_swatches(learned, ("pot", 1), ("lid", 1))
    desk.merge()
    assert grouped <= {*drawn("KARF_MT_swatch")}
    right_click = addon.swatching.draw_context_menu
    assert entries(right_click, button_pointer=learned.karf.objects["lid"].swatches[2]) == ["KARF_MT_swatch"]
    assert entries(right_click, button_pointer=learned.karf) == entries(right_click, button_pointer=None) == []
    desk.pot.swatches[1].is_added = True
    assert "karf.remove_color" in drawn("KARF_MT_swatch")
    desk.pot.swatches[1].is_paint = True
    assert "karf.remove_color" not in drawn("KARF_MT_swatch")


def test_dialogs_show_options_of_the_chosen_format(bpy, addon, learned):
    def draw_dialog(name):
        drawn = []
        operator = SimpleNamespace(layout=Layout(bpy, drawn), bl_rna=getattr(bpy.ops.karf, name).get_rna_type())
        kind = next(each for each in vars(addon.render).values() if getattr(each, "bl_idname", "") == f"karf.{name}")
        vars(operator).update({each: getattr(kind, each).__get__(operator) for each in ("draw", "draw_what")})
        operator.draw(bpy.context)
        return drawn

    karf, drawn = learned.karf, draw_dialog("render_camera")
    assert {"camera", "resolution_x", "frame_start", "frame_end", "frame_step", "file_format", "out"} <= {*drawn}
    assert drawn.count("color_depth") == 2 and karf.color_depth == "8"
    karf.file_format = "OPEN_EXR"
    assert karf.color_depth == "16"
    karf.color_depth, karf.file_format = "32", "PNG"
    assert karf.color_depth == "16"
    drawn = draw_dialog("render_capture")
    assert {"split", "captured_size"} <= {*drawn} and "captured_pixels" not in drawn
    learned.karf.captured_size = "PIXELS"
    assert "captured_pixels" in draw_dialog("render_capture")


# --- two editors -----------------------------------------------------------------------------------------------------
PICTURE_CONTROLS = "KARF_UL_objects karf.mark color KARF_MT_swatch karf.keep_look karf.show_masks mode".split()
SCENE_CONTROLS = "karf.import_capture karf.learn_all karf.segment karf.extract_palette karf.render_camera".split()


def test_two_editors_share_the_steps_and_one_shows_all(learned, desk):
    desk.segmented()
    desk.set(desk.progress, text="", error="", warnings="")
    left, right = desk.draw(VIEW, IMAGE), desk.draw(IMAGE, VIEW)
    in_both = {each for each in {*left} & {*right} if "." in each or each.startswith("KARF_")}
    assert in_both == {"karf.open_manual"}
    assert {*left}.issuperset(SCENE_CONTROLS) and {*left}.isdisjoint(PICTURE_CONTROLS)
    assert {*right}.issuperset(PICTURE_CONTROLS) and {*right}.isdisjoint(SCENE_CONTROLS)
    assert "No job is running" in left and "No job is running" not in right
    assert left.count("Image Editor") == 2  # points to the other steps
    for editor in (VIEW, IMAGE):
        assert {*desk.draw(editor)}.issuperset(SCENE_CONTROLS + PICTURE_CONTROLS)
        assert "Image Editor" not in desk.draw(editor)


def test_both_editors_have_the_panel_and_closed_sidebars_are_ignored(bpy, addon):
    screen = SimpleNamespace(areas=[area(VIEW), area(IMAGE, has_sidebar=False)])
    context = SimpleNamespace(area=screen.areas[0], screen=screen)
    assert addon.sidebar.is_displayed_here(context, IMAGE)
    screen.areas[1].spaces.active.show_region_ui = True
    assert not addon.sidebar.is_displayed_here(context, IMAGE)
    # Blender puts tabs of panels without a header before all others
    panels = addon.sidebar.StepsPanel.__subclasses__()
    assert {panel.bl_space_type for panel in panels} == {VIEW, IMAGE}
    assert all(hasattr(bpy.types, panel.__name__) for panel in panels)
    assert not [panel for panel in panels if "HIDE_HEADER" in getattr(panel, "bl_options", ())]


def test_status_keeps_its_number_of_rows(bpy, addon, desk):
    """No button below it may move when a job starts or ends."""

    class Rows(Layout):
        count = 0

        def row(self, **_):
            Rows.count += 1
            return Layout(bpy, [])

        label = row

        def column(self, **_):
            return self

    for state in ({}, {"running": True}, {"running": False, **FAILED}):
        desk.set(desk.progress, **state)
        Rows.count = 0
        addon.sidebar.draw_status(Rows(bpy, []), bpy.context)
        assert Rows.count == 2


# --- help, disabled steps, icons and keys ----------------------------------------------------------------------------
def test_each_step_opens_its_manual_page(bpy, addon):
    for section in addon.sidebar.SECTIONS:
        assert bpy.ops.karf.open_manual(page=section.page) == {"FINISHED"}
        text = bpy.data.texts["KaRF manual"].as_string()
        assert text.startswith("# ") and not [each for each in ("![", "**", "](") if each in text]
    pages = bpy.ops.karf.open_manual.get_rna_type().properties["page"].enum_items.keys()
    assert sorted(pages) == sorted(file.stem for file in addon.project.MANUAL.glob("*.md"))


def test_disabled_step_gives_its_reason(bpy, addon, scene, capture_folder, tmp_path):
    def assert_rejected(reason, *names):
        for name in names:
            with pytest.raises(RuntimeError, match=reason):
                getattr(bpy.ops.karf, name)()

    assert_rejected("Import a capture", "learn_scene", "segment", "extract_palette", "show_view")
    assert_rejected(r"Import a capture|Extract the palettes", "render_view", "becomes")
    assert_rejected("No job", "cancel")
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    assert_rejected("Learn the scene first", "segment")
    assert_rejected("Segment the objects first", "extract_palette")
    addon.steps.learn_scene(scene).wait()
    assert_rejected("Mark an object first", "segment")
    scene.karf.masks = str(tmp_path)
    assert bpy.ops.karf.segment.poll()


def test_learned_color_is_drawn_as_an_icon(addon):
    tints = addon.tints
    tints.icon((1.0, 0.25, 0.0))
    pixels = addon.session.get(tints.ColorIcons).icons["#ff4000"].icon_pixels_float[:]
    np.testing.assert_allclose(np.reshape(pixels, (-1, 4)), [[1, 0.25, 0, 1]] * tints.ICON_SIDE**2, atol=1 / 255)


def test_before_and_after_keys_are_in_the_image_editor_keymap(bpy, addon):
    items = bpy.context.window_manager.keyconfigs.addon.keymaps["Image"].keymap_items
    wanted = {("karf.before_after", "C", False), ("karf.seeing_pie", "C", True)}
    assert wanted <= {(item.idname, item.type, item.alt) for item in items}
