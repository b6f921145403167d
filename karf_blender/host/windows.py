"""The areas of all open windows."""

from collections.abc import Iterator

import bpy

PANEL_AREAS = ("VIEW_3D", "IMAGE_EDITOR")  # those with the KaRF tab


def editors(*kinds: str) -> Iterator[tuple[bpy.types.Window, bpy.types.Area]]:
    """The areas of these types, in all windows, each with its window."""
    for window in bpy.data.window_managers[0].windows:
        yield from ((window, area) for area in window.screen.areas if area.type in kinds)


def areas(*kinds: str) -> Iterator[bpy.types.Area]:
    """The areas of these types, in all windows."""
    yield from (area for _, area in editors(*kinds))


def redraw(*kinds: str) -> None:
    """Draw the areas of these types again."""
    for area in areas(*kinds):
        area.tag_redraw()


def redraw_sidebars() -> None:
    """Draw the panels again, and not the scene beside them, which may take long."""
    for area in areas(*PANEL_AREAS):
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()
