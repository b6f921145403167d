"""The panels draw in every state of a project, name only what exists, and write nothing."""

import pytest


class Layout:
    """Stands in for Blender's layout: checks what is drawn and remembers it."""

    def __init__(self, bpy, drawn):
        self._bpy, self._drawn = bpy, drawn

    def row(self, **_):
        return Layout(self._bpy, self._drawn)

    column = box = row

    def label(self, text="", **_):
        self._drawn.append(text)

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self._drawn.append(text)

    def prop(self, data, name, **_):
        assert name in data.bl_rna.properties
        self._drawn.append(name)

    def prop_search(self, data, name, where, collection, **_):
        assert collection in where.bl_rna.properties
        self.prop(data, name)

    def operator(self, name, text="", **_):
        group, _, verb = name.partition(".")
        operator = getattr(getattr(self._bpy.ops, group), verb)
        known = set(operator.get_rna_type().properties.keys())
        self._drawn.append(name)
        return Properties(known)


class Properties:
    """An operator's properties as the layout gives them."""

    def __init__(self, known):
        object.__setattr__(self, "known", known)

    def __setattr__(self, name, value):
        assert name in self.known


@pytest.fixture
def draw(bpy, addon):
    def draw_all():
        drawn = []
        for _, _, section in addon.sidebar.SECTIONS:
            section(Layout(bpy, drawn), bpy.context)
        return drawn

    return draw_all


def test_an_empty_file_offers_the_import(draw):
    drawn = draw()
    assert "karf.import_capture" in drawn
    assert "color" not in drawn and "karf.cancel" not in drawn


def test_a_learned_scene_shows_its_swatches_without_the_frozen_black(addon, learned, draw):
    drawn = draw()
    assert drawn.count("color") == drawn.count("learned") == 4  # two objects of two colors
    assert drawn.count("karf.reset_swatch") == 2  # one an object; a swatch has its own once it is edited
    addon.headless.set_swatch("pot", 1, "#00ff00")
    assert draw().count("karf.reset_swatch") == 3


def test_a_view_without_planes_says_so(learned, draw):
    assert "Press Show View: not prepared yet" not in draw()
    learned.karf.active_view = "photo_2"
    assert "Press Show View: not prepared yet" in draw()


def test_a_running_job_and_a_failed_one_are_shown(bpy, draw):
    progress = bpy.context.window_manager.karf_progress
    progress.running, progress.stage, progress.fraction, progress.text = True, "Learn Scene", 0.5, "1/2"
    assert {"Learn Scene: 1/2", "karf.cancel"} <= set(draw())
    progress.running, progress.error, progress.hint = False, "photo_7.png is missing.", "Find it."
    progress.warnings = "The lid is dark."
    assert {"photo_7.png is missing.", "Find it.", "The lid is dark."} <= set(draw())


def test_every_section_is_in_both_editors(bpy, addon):
    spaces = [panel.bl_space_type for panel in addon.sidebar.CLASSES]
    assert spaces.count("VIEW_3D") == spaces.count("IMAGE_EDITOR") == len(addon.sidebar.SECTIONS)
    assert all(hasattr(bpy.types, panel.__name__) for panel in addon.sidebar.CLASSES)


def test_a_greyed_out_step_says_why(bpy, addon, scene):
    for name in ("learn_scene", "segment", "extract_palette", "show_view", "render_view", "becomes", "cancel"):
        with pytest.raises(RuntimeError, match=r"Import a capture|Extract the palettes|No job"):
            getattr(bpy.ops.karf, name)()
