"""A color chart that is clicked in a photo turns names and sheets of colors into what the photos show of them."""

import sys

import numpy as np
import pytest

WARM = np.array([1.0, 0.75, 0.5])


def warm_patches(addon):
    """The chart's patches as a warm light shows them, sRGB [24, 3]."""
    api = addon.engine_api
    chart = sys.modules[api.fit_photo.__module__]
    return np.clip(api.linear_to_srgb(api.srgb_to_linear(chart.reference_colors()) * WARM), 0, 1)


@pytest.fixture
def chart(bpy, addon):
    """A photo of a chart under a warm light, and the corners of its patches in it, from 0 to 1 from below."""
    photo = np.full((120, 180, 4), 0.3, np.float32)
    for number, color in enumerate(warm_patches(addon)):
        row, column = divmod(number, 6)
        photo[20 + 22 * row : 40 + 22 * row, 20 + 22 * column : 40 + 22 * column, :3] = color
    photo[..., 3] = 1
    image = addon.images.new_image("chart.png", 180, 120)
    addon.images.upload(image, np.ascontiguousarray(photo[::-1]))
    across, down = np.array([20, 150]) / 180, np.array([20, 106]) / 120
    yield (
        image,
        [(across[0], 1 - down[0]), (across[1], 1 - down[0]), (across[1], 1 - down[1]), (across[0], 1 - down[1])],
    )
    bpy.data.images.remove(image)


def test_names_are_what_the_photos_show_of_them(bpy, addon, learned, chart):
    image, corners = chart
    fit = addon.steps.pick_chart(learned, image, corners)
    assert fit.mean_residual < 0.5 and learned.karf.chart_left == pytest.approx(fit.mean_residual)
    np.testing.assert_allclose(np.reshape(learned.karf.chart, (3, 3)), np.diag(WARM), atol=0.02)
    seen = addon.colors.as_photographed(learned, np.array([0.4, 0.5, 0.6]))
    expected = addon.engine_api.linear_to_srgb(addon.engine_api.srgb_to_linear(np.array([0.4, 0.5, 0.6])) * WARM)
    np.testing.assert_allclose(seen, expected, atol=0.01)
    np.testing.assert_allclose(addon.colors.as_named(learned, seen), [0.4, 0.5, 0.6], atol=1e-6)


def test_a_chart_goes_before_a_gray_card_and_can_be_removed(bpy, addon, learned, chart):
    learned.karf.card = (0.5, 0.5, 0.5)
    card = addon.colors.reference_light(learned).matrix
    image, corners = chart
    values = [value for place in corners for value in place]
    assert bpy.ops.karf.pick_chart(image=image.name, corners=values) == {"FINISHED"}
    np.testing.assert_allclose(addon.colors.reference_light(learned).matrix, np.diag(WARM), atol=0.02)
    bpy.ops.karf.remove_chart()
    np.testing.assert_array_equal(addon.colors.reference_light(learned).matrix, card)


def test_the_engine_finds_the_chart_in_the_photo_of_a_picture(bpy, addon, learned, chart, tmp_path):
    image, _ = chart
    with pytest.raises(addon.engine_api.BadRequest, match=r"chart\.png has no file"):
        addon.steps.find_chart(learned, image)
    image.filepath_raw = str(tmp_path / "chart.png")
    image.save()
    addon.steps.find_chart(learned, image)
    np.testing.assert_allclose(np.reshape(learned.karf.chart, (3, 3)), np.eye(3) / 2)
    assert learned.karf.chart_left == 0.25


def test_in_a_picture_of_karf_it_is_the_active_views_photo(bpy, addon, learned):
    addon.steps.find_chart(learned, addon.images.new_image("KaRF view", 4, 4))
    assert learned.karf.chart_left == 0.25


def test_what_is_no_chart_is_said_and_forgets_nothing(bpy, addon, learned, chart):
    image, corners = chart
    addon.steps.pick_chart(learned, image, corners)
    before = list(learned.karf.chart)
    with pytest.raises(RuntimeError, match=r"does not look like a color chart|not those of a color chart"):
        bpy.ops.karf.pick_chart(image=image.name, corners=[0, 0.1, 0.1, 0.1, 0.1, 0, 0, 0])
    assert list(learned.karf.chart) == before
    with pytest.raises(RuntimeError, match="No Image Editor shows a photo"):
        bpy.ops.karf.pick_chart(image="nothing", corners=[0] * 8)


def test_the_engine_gets_the_light_of_the_chart_for_a_sheet_of_colorways(bpy, addon, learned, chart, tmp_path):
    image, corners = chart
    sheet = tmp_path / "sheet.csv"
    sheet.write_text("colorway,object,hex\nBrown,pot,#806050\n")
    (plain,) = addon.steps.predict_colorways(learned, sheet)
    addon.steps.pick_chart(learned, image, corners)
    (planned,) = addon.steps.predict_colorways(learned, sheet)
    light = addon.colors.reference_light(learned)
    wanted, seen = plain.predictions[0].target, planned.predictions[0].target
    np.testing.assert_allclose(seen, light.photographed(wanted), atol=1e-4)
    np.testing.assert_allclose(planned.predictions[0].under_light(light).target, wanted, atol=1e-4)
