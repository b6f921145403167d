"""The areas of all open windows."""

from collections.abc import Iterator

import bpy

PANEL_AREAS = ("VIEW_3D", "IMAGE_EDITOR")  # those with the KaRF tab


def areas(*kinds: str) -> Iterator[bpy.types.Area]:
    """The areas of these types, in all windows."""
    for window in bpy.data.window_managers[0].windows:
        yield from (area for area in window.screen.areas if area.type in kinds)


def window_of(area: bpy.types.Area) -> bpy.types.Window:
    """The window that an area is in."""
    return next(window for window in bpy.data.window_managers[0].windows if window.screen == area.id_data)


def redraw(*kinds: str) -> None:
    """Draw the areas of these types again."""
    for area in areas(*kinds):
        area.tag_redraw()


def redraw_sidebars() -> None:
    """Draw the panels again, but not the scene next to them, which may take long."""
    for area in areas(*PANEL_AREAS):
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()
