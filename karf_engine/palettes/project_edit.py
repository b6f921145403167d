"""Edit the swatches of a learned project, also by "this color becomes that color"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import BadRequest
from ..io.arguments import check_arguments
from ..project.folder import Project
from ..project.settings import from_dict
from .added import extended_palettes, match_added_color, paint_of, split_weights, wanted_color
from .color_histogram import read_object_colors
from .edge_shape import EdgeShape, active_edges
from .matching.becomes import match_becomes, match_fewest, nearest_weights
from .matching.surface import Surface, match_surface
from .palette import (
    MAX_ADDED,
    MAX_PROTECT,
    MAX_REACH,
    MAX_SRGB,
    REACH,
    AddedColor,
    Edit,
    Palette,
    hex_to_rgb,
    read_palettes,
)
from .palette_files import read_edit_file, write_edit_file
from .prediction import edited_colors

RULES = ("becomes", "paint", "fewest")
Color = str | Sequence[float] | np.ndarray  # #rrggbb, or three sRGB numbers from 0 to 1


@dataclass(frozen=True, repr=False)
class ProjectEdit(Edit):
    """Edit of a learned project. Every method returns a new edit.

    A color is `#rrggbb`, or three sRGB numbers from 0 to 1. Methods raise BadRequest if the object or swatch is unknown
    or a number is out of range, and DataError if a color is invalid or the project's color histogram is damaged.
    """

    project: Project = field(kw_only=True, repr=False, compare=False)
    palettes: tuple[Palette, ...] = field(kw_only=True, repr=False, compare=False)  # as learned

    @check_arguments
    def becomes(
        self,
        name: str,
        source: Color,
        target: Color,
        rule: str = "becomes",
        also: Sequence[tuple[Color, Color]] = (),
        is_metal: bool = False,
    ) -> ProjectEdit:
        """Turn one color of an object into another.

        Args:
            source: A color that the object shows.
            target: The wanted color.
            rule: `becomes` changes the whole object; `paint` only the source's paint, by an added color, so that other
                paints and neutrals stay; `fewest`, for one pair, as few swatches as possible.
            also: Further pairs of source and target, for an object of several paints. `becomes` solves all pairs
                together, as sequential edits would confuse a new color with an old paint.
            is_metal: Whether highlights take the paint's color rather than the light's; used by `becomes`.
        """
        pairs = (source, target), *also
        sources = np.stack([as_color(first) for first, _ in pairs])
        targets = np.stack([as_color(second) for _, second in pairs])
        if rule == "paint":
            return self._with_paints(name, sources, targets)
        colors = solve(self.project, self._palette(name), sources, targets, rule, is_metal)
        sets = self.colors[name][len(colors) :]
        return replace(self, colors=self.colors | {name: np.concatenate([colors, sets])})

    def _with_paints(self, name: str, sources: np.ndarray, targets: np.ndarray) -> ProjectEdit:
        """Return the edit with an added color for the paint of each source color [P, 3], which becomes its target."""
        edit, seen = self, read_object_colors(self.project.verified(self.project.object_colors_file), name)
        for source, target in zip(sources, targets, strict=True):
            paint = paint_of(seen, source)
            wanted = wanted_color(seen, self._palette(name).colors, paint, source, target)
            edit = edit.add_color(name, paint.picked, wanted, paint.reach, paint.protect)
        return edit

    @check_arguments
    def add_color(
        self, name: str, picked: Color, wanted: Color, reach: float = REACH, protect: float = 0.0
    ) -> ProjectEdit:
        """Give one pigment of an object, not black, its own color, independent of the swatches.

        Args:
            picked: The pigment's color in the photos.
            wanted: Its new color; numbers may go up to 2, brighter than white.
            reach: Width of the pigment in hue (in chroma if gray), above 0 up to 4; 1 is that of `becomes`.
            protect: Share of its saturation, 0 to 0.5, below which colors are neutral and stay; 0.1 suits letters on
                silver or paper, 0 protects none.
        """
        palette, before = self._palette(name), self.added.get(name, ())
        if not 0 < reach <= MAX_REACH:
            raise BadRequest(f"{reach!r} is not a reach.", f"Give a number above 0, up to {MAX_REACH:g}.")
        if not 0 <= protect <= MAX_PROTECT:
            raise BadRequest(f"{protect!r} cannot be protected.", f"Give a number from 0 to {MAX_PROTECT:g}.")
        if len(before) == MAX_ADDED:
            raise BadRequest(f"{name!r} has {MAX_ADDED} added colors.", "Leave one of them out.")
        added = AddedColor(as_color(picked), float(reach), float(protect))
        seen = read_object_colors(self.project.verified(self.project.object_colors_file), name)
        colors = match_added_color(seen, palette.colors, added, as_color(wanted, MAX_SRGB))
        return replace(
            self,
            colors=self.colors | {name: np.concatenate([self.colors[name], colors])},
            added=self.added | {name: (*before, added)},
        )

    @check_arguments
    def swatch(self, name: str, index: int, color: Color) -> ProjectEdit:
        """Set one swatch of an object, from 1, to a color; numbers may go up to 2, brighter than white."""
        self._palette(name, index)
        colors = self.colors[name].copy()
        colors[index] = as_color(color, MAX_SRGB)
        return replace(self, colors=self.colors | {name: colors})

    @check_arguments
    def edge(self, name: str, choke: float = 0.0, feather: float = 0.0) -> ProjectEdit:
        """Move and fade an object's edge, in pixels of the full-size photos (on splats their footprint at the object).

        choke: inward shift of the edge, -16 to 16; negative values grow the object. feather: width of the fade, centered
        on the edge, 0 to 64.
        """
        shape = EdgeShape(float(choke), float(feather))
        return replace(self, edges=active_edges(self.edges | {self._palette(name).name: shape}))

    @check_arguments
    def surface(
        self, name: str, index: int, saturation: float = 1.0, brightness: float = 0.0, gloss: float = 1.0
    ) -> ProjectEdit:
        """Change the current surface of one swatch's paint; other paints and added colors stay.

        Args:
            index: The swatch, from 1.
            saturation: Factor of the distance to gray, 0 to 4; 0 is gray.
            brightness: Lifts or lowers the mid-tones, -2 to 2; black and white stay.
            gloss: Factor of the highlights, 0 to 4; 0 is matte.
        """
        surface, palette, edited = Surface(saturation, brightness, gloss), self._palette(name, index), self.colors[name]
        (whole,), added = extended_palettes([palette], self.added), self.added.get(name, ())
        seen = read_object_colors(self.project.verified(self.project.object_colors_file), name)
        seen = seen._replace(palette_weights=split_weights(seen.palette_weights.T, palette.colors, added).T)
        sets = range(len(palette.colors), len(edited))
        colors = match_surface(
            edited_colors(seen, whole, edited), seen.counts, seen.palette_weights, edited, {index: surface}, sets
        )
        return replace(self, colors=self.colors | {name: colors})

    @check_arguments
    def save(self, path: Path | str) -> None:
        """Write the edit atomically, as JSON or as the palette file of its suffix (`palettes.palette_files`)."""
        write_edit_file(Path(path), self)

    def _palette(self, name: str, index: int | None = None) -> Palette:
        """Return an object's palette; raise BadRequest if the object or swatch is unknown."""
        for palette in self.palettes:
            if palette.name == name:
                if index is not None and not 1 <= index < len(palette.colors):
                    last = len(palette.colors) - 1
                    raise BadRequest(f"{name!r} has no swatch {index}.", f"Its swatches are 1 to {last}.")
                return palette
        raise BadRequest(f"There is no object {name!r}.", f"Objects are: {', '.join(p.name for p in self.palettes)}.")


def edit_of(project: Project, path: Path | str | None = None) -> ProjectEdit:
    """Return an unchanged edit of a project, or the edit in a file.

    Raises BadRequest if the project has no palettes, DataError if their file is damaged, or the edit's file is not an
    edit of them.
    """
    project.require("palette")
    palettes = read_palettes(project.verified(project.palette_file))
    compositing = from_dict(project.state()["settings"]).compositing
    edit = Edit({palette.name: palette.colors for palette in palettes}, compositing)
    if path is not None:
        edit = read_edit_file(Path(path), palettes, compositing)
    return ProjectEdit(edit.colors, edit.compositing, edit.added, edit.edges, project=project, palettes=palettes)


def solve(
    project: Project, palette: Palette, source: np.ndarray, target: np.ndarray, rule: str, is_metal: bool = False
) -> np.ndarray:
    """Return the edited palette [M, 3] that turns `source` [P, 3] into `target` [P, 3], sRGB.

    Raises BadRequest if the rule is not one of `RULES`, or takes one pair only, DataError if the object's color
    histogram is damaged.
    """
    if rule not in RULES:
        raise BadRequest(f"Unknown rule {rule!r}.", f"Use one of: {', '.join(RULES)}.")
    colors, counts, weights = read_object_colors(project.verified(project.object_colors_file), palette.name)
    if rule == "becomes":
        return match_becomes(colors, counts, weights, palette.colors, source, target, is_metal=is_metal)
    if len(source) > 1:
        raise BadRequest("The rule 'fewest' takes one pair of colors.", "Use the rule 'becomes' for several.")
    return match_fewest(nearest_weights(colors, weights, source[0]), palette.colors, target[0], shown=source[0])


def as_color(value: Color, highest: float = 1.0) -> np.ndarray:
    """Convert `#rrggbb` or numbers in [0, highest] to sRGB [3] float32; raise BadRequest or DataError otherwise."""
    if isinstance(value, str):
        return hex_to_rgb(value)
    color = np.asarray(value, np.float32)
    if color.shape != (3,) or not ((color >= 0) & (color <= highest)).all():
        raise BadRequest(
            f"{value!r:.200} is not a color.", f"Give #rrggbb, or three sRGB numbers from 0 to {highest:g}."
        )
    return color
