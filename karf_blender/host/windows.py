"""The areas of all open windows."""

from collections.abc import Iterator

import bpy

PANEL_AREAS = ("VIEW_3D", "IMAGE_EDITOR")  # those with the KaRF tab


def areas(*kinds: str) -> Iterator[bpy.types.Area]:
    """Yield the areas of these types in all windows."""
    for window in bpy.data.window_managers[0].windows:
        yield from (area for area in window.screen.areas if area.type in kinds)


def window_of(area: bpy.types.Area) -> bpy.types.Window:
    """Return the window of an area."""
    return next(window for window in bpy.data.window_managers[0].windows if window.screen == area.id_data)


def redraw(*kinds: str) -> None:
    """Redraw the areas of these types; by default, of those with the KaRF tab."""
    for area in areas(*(kinds or PANEL_AREAS)):
        area.tag_redraw()


def redraw_sidebars() -> None:
    """Redraw the panels, but not the scene next to them, which may be slow."""
    for area in areas(*PANEL_AREAS):
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()


def show_text(name: str, content: str) -> bpy.types.Text:
    """Write a text datablock and, except in background mode, show it in an open Text Editor or a new window."""
    text = bpy.data.texts.get(name) or bpy.data.texts.new(name)
    text.from_string(content)
    if not bpy.app.background:
        editor = _text_editor().spaces.active
        editor.text, editor.top = text, 0
        editor.show_word_wrap, editor.show_syntax_highlight, editor.show_line_numbers = True, False, False
    return text


def _text_editor() -> bpy.types.Area:
    known = next(areas("TEXT_EDITOR"), None)
    if known is not None:
        return known
    bpy.ops.wm.window_new()
    area = bpy.context.window_manager.windows[-1].screen.areas[0]
    area.type = "TEXT_EDITOR"
    return area
