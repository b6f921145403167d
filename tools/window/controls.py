"""Each control of an object's colors by mouse: surfaces, edges, metal, neutrals, names, the gray card; where panels are. Runs
inside Blender."""

from __future__ import annotations

from collections.abc import Generator

import bpy

from . import acts, desk, hands, menus, pickers
from .acts import BESIDE_PICTURE, PICTURE, STEPS, VIEW, Story, check, until
from .hands import Place, Wait
from .telling import Chapter

CHAPTER = Chapter()
OBJECT = "pot"
SWATCH_EYE = 0.09  # of the sidebar's width: the eye below an object's first swatch
METAL, RESET = 0.79, 0.72  # likewise the button of a metal, and the one at the end of a row of surfaces
BESIDE = 8  # pixels from a field's edge to the button beside it
MOST_UNDONE = 12
FIND_SECONDS = 120.0  # in which a busy machine has found a chart
MOST_LEFT = 2.0  # CIEDE2000 of a chart's patches, up to which it counts as a good fit
BOOK = "name,hex\nSky,#3fa9f5\nLeaf,#3a9d3a\nBrick,#a03c28\nStone,#8a8a86\n"


def item() -> bpy.types.PropertyGroup:
    """The object whose controls are tried; undo replaces it."""
    return desk.scene().karf.objects[OBJECT]


def unfold(name: str) -> Wait:
    """Open a folded part of the object's controls by a click."""
    yield from hands.press_button(BESIDE_PICTURE, pickers.of_object(OBJECT, name))
    check(getattr(item(), name), f"{name} does not open")


def pull(pattern: str, by: int, first: float) -> Wait:
    """Drag a number by some pixels."""
    x, y = yield from hands.find(BESIDE_PICTURE, pattern, first)
    yield from hands.drag([(x + by * step // 8, y) for step in range(9)])


def undo_to(picture: str, swatches: dict) -> Wait:
    """Ctrl Z until all is as it was."""
    wanted = picture, swatches, False
    for _ in range(MOST_UNDONE):
        if (desk.picture(), desk.swatches(), item().is_metal) == wanted:
            return
        yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True)
        yield 0.3
    raise acts.Broken("undo does not lead back")


def below_swatch() -> Generator[float, None, Place]:
    """The place of the menu's button below the object's first swatch."""
    eye = rf'karf\.solo_swatch\(object_name="{OBJECT}"(, index=1)?\)'
    place = yield from hands.find(BESIDE_PICTURE, eye, SWATCH_EYE)
    x, y = yield from hands.edge(BESIDE_PICTURE, eye, place, (4, 0))
    return x + BESIDE, y


def beside_target() -> Generator[float, None, Place]:
    """The place of the button with names beside the object's target color."""
    target = pickers.of_object(OBJECT, "target")
    place = yield from hands.find(BESIDE_PICTURE, target, 0.68)
    x, y = yield from hands.edge(BESIDE_PICTURE, target, place, (4, 0))
    return x + BESIDE, y


@CHAPTER.step("surface", "mouse: Surface is opened, saturation, brightness and gloss dragged, one reset; keys: Ctrl Z")
def surface(story: Story) -> Wait:
    picture, swatches, seen = desk.picture(), desk.swatches(), []
    yield from unfold("show_surface")
    for name, by, first in (("saturation", -25, 0.32), ("brightness", 15, 0.57), ("gloss", -25, 0.68)):
        yield from pull(pickers.swatch(OBJECT, 1, name), by, first)
        seen.append(desk.picture())
        story.note(f"{name} {getattr(item().swatches[1], name):.2f}")
        check(desk.is_in_step(), f"after {name} the picture is not what the swatches say")
    yield from story.shoot("surface")
    check(seen[0] != picture and seen[1] != seen[0], "the picture does not follow saturation and brightness")
    check(desk.swatches() == swatches, "a surface changes the colors that were chosen")
    reset = rf'karf\.reset_surface\(object_name="{OBJECT}"(, index=1)?\)'
    yield from hands.press_button(BESIDE_PICTURE, reset, RESET)
    check(desk.picture() == picture, "the button at the row's end does not bring the picture back")
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True)
    yield 0.3
    check(desk.picture() == seen[-1], "undo does not bring the surface back")
    yield from hands.press_button(BESIDE_PICTURE, reset, RESET)
    yield from hands.press_button(BESIDE_PICTURE, pickers.of_object(OBJECT, "show_surface"))


@CHAPTER.step("edge", "mouse: Edge is opened, choke and feather dragged; keys: Ctrl Z")
def edge(story: Story) -> Wait:
    picture, swatches, seen = desk.picture(), desk.swatches(), []
    yield from unfold("show_edge")
    for name, by, first in (("choke", 40, 0.2), ("feather", 60, 0.68)):
        yield from pull(pickers.of_object(OBJECT, name), by, first)
        seen.append(desk.picture())
        story.note(f"{name} {getattr(item(), name):.1f}")
        check(getattr(item(), name) != 0 and desk.is_in_step(), f"the picture does not follow {name}")
    yield from story.shoot("edge")
    check(len({picture, *seen}) == 3, "the picture does not follow choke and feather")
    yield from undo_to(picture, swatches)
    yield from hands.press_button(BESIDE_PICTURE, pickers.of_object(OBJECT, "show_edge"))


@CHAPTER.step("metal", "mouse: Metal, a swatch dragged, Metal again; keys: Ctrl Z")
def metal(story: Story) -> Wait:
    picture, swatches = desk.picture(), desk.swatches()
    yield from hands.press_button(BESIDE_PICTURE, pickers.of_object(OBJECT, "is_metal"), METAL)
    check(item().is_metal and desk.is_in_step(), "the button does not make it a metal")
    yield from pickers.drag_swatch(story, OBJECT, 1, 6, (20, 40))
    as_metal = desk.picture()
    yield from story.shoot("metal")
    yield from hands.press_button(BESIDE_PICTURE, pickers.of_object(OBJECT, "is_metal"), METAL)
    story.note("highlights differ" if desk.picture() != as_metal else "this object's highlights do not differ")
    check(not item().is_metal and desk.is_in_step(), "the button does not make it paint again")
    yield from undo_to(picture, swatches)


@CHAPTER.step("protect neutrals", "mouse: a swatch's menu, Protect Neutrals; keys: Ctrl Z")
def protect(story: Story) -> Wait:
    picture, swatches = desk.picture(), desk.swatches()
    place = yield from below_swatch()
    yield from menus.open_below(BESIDE_PICTURE, place, r"karf\.protect_neutrals")
    yield from story.shoot("swatch-menu")
    yield from hands.press("ESC", place)
    yield from menus.choose_below(BESIDE_PICTURE, place, r"karf\.protect_neutrals")
    yield 0.3
    yield from story.shoot("protected")
    check(len(desk.swatches()[OBJECT]) > len(swatches[OBJECT]), "there is no swatch for the pigment")
    check(item().swatches[len(swatches[OBJECT])].protect > 0, "it does not protect neutrals")
    check(desk.is_in_step(), "the picture is not what the swatches say")
    yield from undo_to(picture, swatches)


@CHAPTER.step(
    "color names", "mouse: One color becomes another, its names, Color Book, a name; path by script, keys: Ctrl Z"
)
def color_names(story: Story) -> Wait:
    picture, swatches, sheet = desk.picture(), desk.swatches(), story.desk / "paints.csv"
    sheet.write_text(BOOK)
    yield from unfold("show_becomes")
    place = yield from beside_target()
    yield from menus.choose_below(BESIDE_PICTURE, place, r"karf\.choose_color_book")
    yield from acts.file_browser(story.desk, sheet.name)
    book, problem = desk.module("preferences.color_book").known()
    check(book is not None and len(book.names) == 4, f"the book is not there: {problem}")
    place = yield from beside_target()
    name = yield from menus.open_below(BESIDE_PICTURE, place, r"karf\.use_color_name")
    yield from story.shoot("color-names")
    yield from hands.click(name)
    yield 0.3
    names = {tuple(round(float(value), 3) for value in book[name]) for name in book.names}
    check(tuple(round(value, 3) for value in item().target) in names, f"{tuple(item().target)} is no name's color")
    yield from undo_to(picture, swatches)


@CHAPTER.step("gray card", "mouse: Advanced is opened; keys: E over Gray Card; mouse: a click in the picture")
def gray_card(story: Story) -> Wait:
    karf = desk.scene().karf
    yield from hands.press_button(BESIDE_PICTURE, pickers.of_object(OBJECT, "show_becomes"))
    last = r"karf\.prepare_views"
    place = yield from hands.find(BESIDE_PICTURE, last)
    x, y = yield from hands.edge(BESIDE_PICTURE, last, place, (0, -4))
    yield from hands.click((x, y - hands.ROW))
    field = yield from hands.find(BESIDE_PICTURE, r"karf\.card", 0.68)
    yield from hands.press("E", field)
    at = acts.on_photo(*desk.middle_of("mug"))
    yield from hands.move(at)
    yield from story.shoot("gray-card")
    yield from hands.click(at)
    yield 0.3
    picked = tuple(round(value, 3) for value in karf.card)
    story.note(f"the card is {picked}")
    karf.card = 0, 0, 0
    check(any(picked), "no card was picked")


@CHAPTER.step(
    "color chart",
    "script: its photo is opened; mouse: Pick Color Chart, four clicks in the photo, Remove Color Chart, Find Color Chart",
)
def color_chart(story: Story) -> Wait:
    karf, editor = desk.scene().karf, hands.area_of("IMAGE_EDITOR").spaces.active
    shown = editor.image
    editor.image = bpy.data.images.load(str(story.desk / story.job["chart"]))
    with hands.inside(PICTURE):
        bpy.ops.image.view_all(fit_view=True)
    yield 0.5
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.pick_chart")
    yield from story.shoot("color-chart-asked")
    for place in story.job["chart_corners"]:
        yield from hands.click(acts.on_photo(*place))
    yield from story.shoot("color-chart")
    story.note(f"CIEDE2000 {karf.chart_left:.2f} left in the mean")
    check(any(karf.chart) and karf.chart_left < MOST_LEFT, "four clicks do not fit the chart")
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.remove_chart")
    check(not any(karf.chart), "the chart is not removed")
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.find_chart")
    yield from until(lambda: any(karf.chart), "the chart that the engine finds", FIND_SECONDS)
    yield from story.shoot("color-chart-found")
    story.note(f"found by the engine: {karf.chart_left:.2f}")
    check(karf.chart_left < MOST_LEFT, "what the engine has found does not fit")
    yield from hands.press_button(BESIDE_PICTURE, r"karf\.remove_chart")
    editor.image = shown
    yield 0.5


@CHAPTER.step("manual", "mouse: the question mark of a step; script: its window is closed")
def manual(story: Story) -> Wait:
    manager = bpy.data.window_managers[0]
    yield from hands.press_button(STEPS, r"karf\.open_manual\(page=.render.\)", hands.RIGHT)
    yield from until(lambda: len(manager.windows) == 2, "the manual's window", 10)
    yield 1.0
    yield from story.shoot("manual")
    new = manager.windows[-1]
    text = new.screen.areas[0].spaces.active.text
    check(text is not None and "render" in text.as_string().lower(), "the manual has no page")
    with bpy.context.temp_override(window=new):
        bpy.ops.wm.window_close()
    yield 0.5


@CHAPTER.step("one sidebar", "keys: N over the picture puts its sidebar away, its swatches come to the other; N again")
def one_sidebar(story: Story) -> Wait:
    yield from hands.press("N", hands.middle_of(PICTURE))
    yield 0.5
    yield from hands.find(STEPS, pickers.swatch(OBJECT, 1), 0.2)
    yield from story.shoot("one-sidebar")
    yield from hands.press("N", hands.middle_of(PICTURE))
    yield 0.5
    yield from acts.show_tab()
    yield from hands.find(BESIDE_PICTURE, pickers.swatch(OBJECT, 1), 0.2)
    yield from story.shoot("both-sidebars")
