"""Colors by name: a book chosen once is read once, its nearest names are in the menus, and pressing one sets the color."""

from types import SimpleNamespace

import numpy as np
import pytest

from ..layout import Layout, drawn_preferences

BOOK = "name,hex,lab\nTraffic red,#b3241b,\nSky,#3a7fb0,\nNeon,,60 90 -90\n"


@pytest.fixture
def book(bpy, addon, tmp_path):
    """A book that is chosen in the preferences; none is before and after."""
    path = tmp_path / "inks.csv"
    path.write_text(BOOK)
    bpy.ops.karf.choose_color_book(filepath=str(path))
    yield path
    addon.preferences.current().color_book = ""


def swatch(scene, index=1):
    return scene.karf.objects["pot"].swatches[index]


def drawn(bpy, addon, menu, scene, index=1):
    """What a menu of the pot's swatch shows."""
    found = []
    item = scene.karf.objects["pot"]
    context = SimpleNamespace(karf_object=item, karf_swatch=item.swatches[index])
    getattr(addon.swatching, menu).draw(SimpleNamespace(layout=Layout(bpy, found)), context)
    return found


def test_a_swatch_says_its_numbers_and_its_nearest_names(bpy, addon, learned, book):
    swatch(learned).color = (1, 0, 0)
    texts = drawn(bpy, addon, "KARF_MT_swatch_names", learned)
    assert "Lab (D65)   53.2   80.1   67.2" in texts
    assert "LCh (D65)   53.2   104.6   40.0\N{DEGREE SIGN}" in texts
    names = [text for text in texts if ": visible (" in text]
    assert [name.partition(":")[0] for name in names] == ["Traffic red", "Neon", "Sky"]


def test_without_a_book_there_are_numbers_and_the_way_to_one(bpy, addon, learned):
    texts = drawn(bpy, addon, "KARF_MT_swatch_names", learned)
    assert "karf.choose_color_book" in texts and "karf.use_color_name" not in texts
    with pytest.raises(RuntimeError, match="No color book is chosen"):
        bpy.ops.karf.use_color_name(object_name="pot", index=1, color_name="Sky")


def test_a_name_sets_the_swatch_and_its_material_follows(bpy, addon, learned, book):
    dragged = swatch(learned)
    before = np.array(swatch(learned, 2).color)
    dragged.color = [int("3a7fb0"[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    follows = np.array(swatch(learned, 2).color)
    addon.edits.reset(learned, "pot")
    np.testing.assert_allclose(swatch(learned, 2).color, before, atol=1e-6)
    bpy.ops.karf.use_color_name(object_name="pot", index=1, color_name="Sky")
    assert addon.engine_api.rgb_to_hex(np.array(dragged.color)) == "#3a7fb0"
    np.testing.assert_allclose(swatch(learned, 2).color, follows, atol=1e-5)
    assert any(": invisible (0.0)" in text for text in drawn(bpy, addon, "KARF_MT_swatch_names", learned))


def test_a_name_sets_the_target_color(bpy, addon, learned, book):
    bpy.ops.karf.use_color_name(object_name="pot", color_name="traffic RED")
    target = learned.karf.objects["pot"].target
    assert addon.engine_api.rgb_to_hex(np.array(target)) == "#b3241b"
    assert any("Traffic red: invisible" in text for text in drawn(bpy, addon, "KARF_MT_target_names", learned))


def test_any_name_can_be_searched_for(bpy, addon, learned, book):
    bpy.ops.karf.find_color_name(object_name="pot", index=1, entry="1")
    assert addon.engine_api.rgb_to_hex(np.array(swatch(learned).color)) == "#3a7fb0"


def test_a_color_that_no_picture_shows_is_said(bpy, addon, learned, book):
    read = addon.color_book.known().book
    assert addon.steps.use_color_name(learned, "pot", 1, read, "Neon") > 3
    assert addon.steps.use_color_name(learned, "pot", 1, read, "Sky") == 0


def test_a_locked_swatch_stays(bpy, addon, learned, book):
    swatch(learned).locked = True
    with pytest.raises(RuntimeError, match="locked"):
        bpy.ops.karf.use_color_name(object_name="pot", index=1, color_name="Sky")


def test_a_book_is_read_again_only_where_it_has_changed(bpy, addon, learned, book, monkeypatch):
    read = []
    real = addon.color_book.read_color_book
    monkeypatch.setattr(addon.color_book, "read_color_book", lambda path: read.append(path) or real(path))
    for _ in range(3):
        drawn(bpy, addon, "KARF_MT_swatch_names", learned)
    assert not read
    book.write_text(BOOK + "More,#00ff00\n")
    assert len(addon.color_book.known().book) == 4 and len(read) == 1


@pytest.mark.parametrize("content, sentence", [("name,hex\nRed,red\n", "is not a color"), (None, "does not exist")])
def test_a_damaged_or_missing_book_is_said_in_the_menu(bpy, addon, learned, book, content, sentence):
    book.unlink() if content is None else book.write_text(content)
    texts = drawn(bpy, addon, "KARF_MT_swatch_names", learned)
    assert sentence in " ".join(texts) and "karf.use_color_name" not in texts
    with pytest.raises(RuntimeError, match=sentence):
        bpy.ops.karf.use_color_name(object_name="pot", index=1, color_name="Sky")


def test_a_file_that_is_no_book_is_not_chosen(bpy, addon, learned, book, tmp_path):
    (tmp_path / "other.acb").write_bytes(b"8BPS")
    with pytest.raises(RuntimeError, match="does not begin with 8BCB"):
        bpy.ops.karf.choose_color_book(filepath=str(tmp_path / "other.acb"))
    assert addon.preferences.current().color_book == str(book)


def test_a_name_can_be_undone(bpy, addon, learned, book):
    before = np.array(swatch(learned).color)
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.karf.use_color_name(object_name="pot", index=1, color_name="Sky")
    bpy.ops.ed.undo_push(message="named")
    bpy.ops.ed.undo()
    np.testing.assert_allclose(swatch(bpy.context.scene).color, before, atol=1e-6)


def test_the_preferences_say_why_a_book_cannot_be_read(bpy, addon, book):
    assert "is not a color" not in drawn_preferences(bpy, addon.preferences.current())
    book.write_text("name,hex\nRed,red\n")
    assert "is not a color" in drawn_preferences(bpy, addon.preferences.current())


def test_a_relative_path_is_made_whole(bpy, addon, learned, book, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    preferences = addon.preferences.current()
    preferences.color_book = "//inks.csv"
    assert preferences.color_book == str(book) and len(addon.color_book.known().book) == 3


def test_a_gray_card_turns_names_into_what_the_photos_show_of_them(bpy, addon, learned, book):
    api = addon.engine_api
    warm = (0.6, 0.46, 0.35)
    learned.karf.card = warm
    bpy.ops.karf.use_color_name(object_name="pot", index=1, color_name="Sky")
    light = api.ReferenceLight.of_card(np.array(warm))
    wanted = light.photographed(api.hex_to_rgb("#3a7fb0"))
    np.testing.assert_allclose(swatch(learned).color, wanted, atol=1e-5)
    assert np.abs(wanted - api.hex_to_rgb("#3a7fb0")).max() > 0.05
    names = [text for text in drawn(bpy, addon, "KARF_MT_swatch_names", learned) if text.startswith("Sky")]
    assert names and "invisible" in names[0]  # read back under daylight it is that color


def test_a_card_that_tells_nothing_is_said_and_changes_nothing(bpy, addon, learned, book):
    learned.karf.card = (1, 1, 1)
    found = []
    addon.editing.draw_light(Layout(bpy, found), learned)
    assert found[-2:] == ["card", "The card is too dark or too bright at this point"]
    bpy.ops.karf.use_color_name(object_name="pot", index=1, color_name="Sky")
    assert addon.engine_api.rgb_to_hex(np.array(swatch(learned).color)) == "#3a7fb0"
