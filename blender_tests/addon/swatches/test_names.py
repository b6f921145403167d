"""Color names from a book, and the light that a color chart or a gray card gives them."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from ..layout import Layout, drawn_preferences
from .scenes import color

BOOK = "name,hex,lab\nTraffic red,#b3241b,\nSky,#3a7fb0,\nNeon,,60 90 -90\n"
WARM = np.array([1.0, 0.75, 0.5])


@pytest.fixture
def book(bpy, addon, tmp_path):
    """A color book chosen in the preferences for this test."""
    path = tmp_path / "inks.csv"
    path.write_text(BOOK)
    bpy.ops.karf.choose_color_book(filepath=str(path))
    yield path
    addon.preferences.current().color_book = ""


@pytest.fixture
def use(bpy):
    """Apply a color name to the pot, to its first swatch unless told otherwise."""
    return lambda name, index=1: bpy.ops.karf.use_color_name(object_name="pot", color_name=name, index=index)


@pytest.fixture
def drawn(bpy, addon, learned):
    """Returns the texts and operators in a menu of the pot's first swatch."""

    def drawn(menu="KARF_MT_swatch_names"):
        found, item = [], learned.karf.objects["pot"]
        context = SimpleNamespace(karf_object=item, karf_swatch=item.swatches[1])
        getattr(addon.swatching, menu).draw(SimpleNamespace(layout=Layout(bpy, found)), context)
        return found

    return drawn


def test_swatch_menu_shows_color_numbers_and_nearest_names(learned, book, drawn):
    learned.karf.objects["pot"].swatches[1].color = (1, 0, 0)
    texts = drawn()
    assert {"Lab (D65)   53.2   80.1   67.2", "LCh (D65)   53.2   104.6   40.0\N{DEGREE SIGN}"} <= {*texts}
    names = [text for text in texts if ": visible (" in text]
    assert [name.partition(":")[0] for name in names] == ["Traffic red", "Neon", "Sky"]


def test_menu_without_a_book_offers_to_choose_one(drawn, use):
    texts = drawn()
    assert "karf.choose_color_book" in texts and "karf.use_color_name" not in texts
    with pytest.raises(RuntimeError, match="No color book is chosen"):
        use("Sky")


def test_color_name_sets_the_swatch_with_its_material_or_the_target(bpy, addon, learned, book, drawn, use):
    learned.karf.objects["pot"].swatches[1].color = addon.engine_api.hex_to_rgb("#3a7fb0")
    follows = color(learned, "pot", 2)
    addon.edits.reset(learned, "pot")
    use("Sky")
    assert addon.engine_api.rgb_to_hex(color(learned, "pot", 1)) == "#3a7fb0"
    np.testing.assert_allclose(color(learned, "pot", 2), follows, atol=1e-5)
    assert any(": invisible (0.0)" in text for text in drawn())
    bpy.ops.karf.find_color_name(object_name="pot", index=1, entry="0")
    assert addon.engine_api.rgb_to_hex(color(learned, "pot", 1)) == "#b3241b"
    learned.karf.objects["pot"].swatches[1].locked = True
    with pytest.raises(RuntimeError, match="locked"):
        use("Sky")
    use("traffic RED", index=0)
    assert addon.engine_api.rgb_to_hex(learned.karf.objects["pot"].target) == "#b3241b"
    assert any("Traffic red: invisible" in text for text in drawn("KARF_MT_target_names"))


def test_out_of_gamut_names_and_relative_book_paths_work(bpy, addon, learned, book, tmp_path):
    read = addon.color_book.known().book
    assert addon.steps.use_color_name(learned, "pot", 1, read, "Neon") > 3
    assert addon.steps.use_color_name(learned, "pot", 1, read, "Sky") == 0
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    preferences = addon.preferences.current()
    preferences.color_book = "//inks.csv"
    assert preferences.color_book == str(book) and len(addon.color_book.known().book) == 3


def test_book_is_read_again_only_after_a_change(addon, book, drawn, monkeypatch):
    read = []
    real = addon.color_book.read_color_book
    monkeypatch.setattr(addon.color_book, "read_color_book", lambda path: read.append(path) or real(path))
    for _ in range(3):
        drawn()
    assert not read
    book.write_text(BOOK + "More,#00ff00\n")
    assert len(addon.color_book.known().book) == 4 and len(read) == 1


@pytest.mark.parametrize("content, sentence", [("name,hex\nRed,red\n", "is not a color"), (None, "does not exist")])
def test_menu_and_preferences_report_a_damaged_book(bpy, addon, book, drawn, use, content, sentence):
    assert sentence not in drawn_preferences(bpy, addon.preferences.current())
    book.unlink() if content is None else book.write_text(content)
    assert sentence in " ".join(drawn()) and "karf.use_color_name" not in drawn()
    assert sentence in drawn_preferences(bpy, addon.preferences.current())
    with pytest.raises(RuntimeError, match=sentence):
        use("Sky")


def test_other_files_are_not_chosen_as_a_book(bpy, addon, book, tmp_path):
    (tmp_path / "other.acb").write_bytes(b"8BPS")
    with pytest.raises(RuntimeError, match="does not begin with 8BCB"):
        bpy.ops.karf.choose_color_book(filepath=str(tmp_path / "other.acb"))
    assert addon.preferences.current().color_book == str(book)


def test_gray_card_lights_color_names(bpy, addon, learned, book, drawn, use):
    api, card = addon.engine_api, np.array((0.6, 0.46, 0.35))
    learned.karf.card = card
    use("Sky")
    wanted = api.ReferenceLight.of_card(card).photographed(api.hex_to_rgb("#3a7fb0"))
    np.testing.assert_allclose(color(learned, "pot", 1), wanted, atol=1e-5)
    assert np.abs(wanted - api.hex_to_rgb("#3a7fb0")).max() > 0.05
    names = [text for text in drawn() if text.startswith("Sky")]
    assert names and "invisible" in names[0]  # converted back to daylight, it is that color
    learned.karf.card = (1, 1, 1)
    found = []
    addon.editing.draw_light(Layout(bpy, found), learned)
    assert found[-2:] == ["card", "The card is too dark or too bright at this point"]
    use("Sky")
    assert addon.engine_api.rgb_to_hex(color(learned, "pot", 1)) == "#3a7fb0"


@pytest.fixture
def chart(bpy, addon):
    """A photo of a chart under warm light, and the chart's corners from 0 to 1, y upward."""
    api = addon.engine_api
    reference = sys.modules[api.fit_photo.__module__].reference_colors()
    patches = np.clip(api.linear_to_srgb(api.srgb_to_linear(reference) * WARM), 0, 1)
    photo = np.full((120, 180, 4), [0.3, 0.3, 0.3, 1], np.float32)
    for number, patch in enumerate(patches):
        row, column = divmod(number, 6)
        photo[20 + 22 * row : 40 + 22 * row, 20 + 22 * column : 40 + 22 * column, :3] = patch
    image = addon.images.new_image("chart.png", 180, 120)
    addon.images.upload(image, np.ascontiguousarray(photo[::-1]))
    left, right, top, bottom = 20 / 180, 150 / 180, 1 - 20 / 120, 1 - 106 / 120
    yield image, [(left, top), (right, top), (right, bottom), (left, bottom)]
    bpy.data.images.remove(image)


def test_chart_converts_names_to_photographed_colors(addon, learned, chart):
    fit, named = addon.steps.pick_chart(learned, *chart), np.array([0.4, 0.5, 0.6])
    assert fit.mean_residual < 0.5 and learned.karf.chart_left == pytest.approx(fit.mean_residual)
    np.testing.assert_allclose(np.reshape(learned.karf.chart, (3, 3)), np.diag(WARM), atol=0.02)
    seen = addon.colors.as_photographed(learned, named)
    expected = addon.engine_api.linear_to_srgb(addon.engine_api.srgb_to_linear(named) * WARM)
    np.testing.assert_allclose(seen, expected, atol=0.01)
    np.testing.assert_allclose(addon.colors.as_named(learned, seen), named, atol=1e-6)


def test_chart_overrides_a_gray_card_until_removed(bpy, addon, learned, chart):
    learned.karf.card = (0.5, 0.5, 0.5)
    card, (image, corners) = addon.colors.reference_light(learned).matrix, chart
    assert bpy.ops.karf.pick_chart(image=image.name, corners=np.ravel(corners)) == {"FINISHED"}
    np.testing.assert_allclose(addon.colors.reference_light(learned).matrix, np.diag(WARM), atol=0.02)
    before = list(learned.karf.chart)
    with pytest.raises(RuntimeError, match=r"does not look like a color chart|not those of a color chart"):
        bpy.ops.karf.pick_chart(image=image.name, corners=[0, 0.1, 0.1, 0.1, 0.1, 0, 0, 0])
    with pytest.raises(RuntimeError, match="No Image Editor shows a photo"):
        bpy.ops.karf.pick_chart(image="nothing", corners=[0] * 8)
    assert list(learned.karf.chart) == before
    bpy.ops.karf.remove_chart()
    np.testing.assert_array_equal(addon.colors.reference_light(learned).matrix, card)


def test_engine_finds_the_chart_in_a_photo(addon, learned, chart, tmp_path):
    image, _ = chart
    with pytest.raises(addon.engine_api.BadRequest, match=r"chart\.png has no file"):
        addon.steps.find_chart(learned, image)
    image.filepath_raw = str(tmp_path / "chart.png")
    image.save()
    for picture in (image, addon.images.new_image("KaRF view", 4, 4)):  # KaRF's own stands for the active view's photo
        addon.colors.forget_chart(learned)
        addon.steps.find_chart(learned, picture)
        np.testing.assert_allclose(np.reshape(learned.karf.chart, (3, 3)), np.eye(3) / 2)
        assert learned.karf.chart_left == 0.25


def test_colorway_sheets_use_the_charts_light(addon, learned, chart, tmp_path):
    sheet = tmp_path / "sheet.csv"
    sheet.write_text("colorway,object,hex\nBrown,pot,#806050\n")
    (plain,) = addon.steps.predict_colorways(learned, sheet)
    addon.steps.pick_chart(learned, *chart)
    (planned,) = addon.steps.predict_colorways(learned, sheet)
    light, wanted = addon.colors.reference_light(learned), plain.predictions[0].target
    np.testing.assert_allclose(planned.predictions[0].target, light.photographed(wanted), atol=1e-4)
    np.testing.assert_allclose(planned.predictions[0].under_light(light).target, wanted, atol=1e-4)
