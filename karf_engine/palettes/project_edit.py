"""An edit of a learned project: which swatches change, and "this color becomes that color". Without torch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import BadRequest
from ..io.arguments import checked
from ..project.folder import Project
from ..project.settings import from_dict
from .added import palettes_with, solve_set, spread
from .colorways.reached import shown
from .edge_shape import EdgeShape, shaped_edges
from .matching.becomes import match_becomes, match_fewest, nearest_weights
from .matching.surface import Surface, match_surface
from .object_colors import read_object_colors
from .palette import (
    BRIGHTEST,
    MOST_ADDED,
    MOST_PROTECT,
    MOST_REACH,
    REACH,
    AddedColor,
    Edit,
    Palette,
    hex_to_rgb,
    read_palettes,
)
from .palette_files import read_edit_file, write_edit_file

RULES = ("becomes", "fewest")
Color = str | Sequence[float] | np.ndarray  # #rrggbb, or three sRGB numbers from 0 to 1


@dataclass(frozen=True, repr=False)
class ProjectEdit(Edit):
    """An edit that knows the project it is for. Each method gives a new edit; nothing is changed in place.

    Attributes:
        colors: edited palette of every object by its name, [M, 3] float32 sRGB; entry 0 is black. The sets of added
            colors stand behind it.
        compositing: `delta` adds the palette's change to the picture, `paper` replaces it by the palette's mixture.
        added: added colors of objects that have some, by name.
        edges: how the edges of objects are moved and faded, by name.
        project: the learned project.
        palettes: its palettes as learned.
    """

    project: Project = field(kw_only=True, repr=False, compare=False)
    palettes: tuple[Palette, ...] = field(kw_only=True, repr=False, compare=False)

    @checked
    def becomes(
        self,
        name: str,
        source: Color,
        target: Color,
        rule: str = "becomes",
        also: Sequence[tuple[Color, Color]] = (),
        is_metal: bool = False,
    ) -> ProjectEdit:
        """Let one color that an object shows become another.

        Args:
            name: the object.
            source: a color that it shows.
            target: the color that this one becomes.
            rule: `becomes` carries the whole material along; `fewest` changes as few swatches as possible.
            also: of a thing of several paints further pairs of source and target, which `becomes` solves together with
                the first: one after the other would take what a paint has become for another paint.
            is_metal: whether highlights take the paint's color, and not the light's; of the rule `becomes`.

        Raises:
            BadRequest: there is no such object or rule, or a rule was given pairs that it cannot solve together.
            DataError: a color is none, or the project's histogram of the object's colors is damaged.
        """
        sources, targets = zip((source, target), *also, strict=True)
        pairs = (np.stack([as_color(each) for each in colors]) for colors in (sources, targets))
        colors = solve(self.project, self._palette(name), *pairs, rule, is_metal)
        sets = self.colors[name][len(colors) :]
        return replace(self, colors=self.colors | {name: np.concatenate([colors, sets])})

    @checked
    def add_color(
        self, name: str, picked: Color, wanted: Color, reach: float = REACH, protect: float = 0.0
    ) -> ProjectEdit:
        """Let one pigment of an object have a color of its own, and leave it out of what the swatches change.

        Args:
            name: the object.
            picked: the pigment, as photos show it.
            wanted: the color that it gets; numbers may go up to 2, brighter than white.
            reach: how far around its hue, or in chroma where it is grey, other colors are of it: over 0 up to 4; 1 is as far as
                `becomes` reaches.
            protect: share of its saturation, 0 to 0.5, under which colors are neutral and stay: for letters on silver or
                paper 0.1. 0: hue alone decides.

        Raises:
            BadRequest: there is no such object, it has 16 added colors already, the pigment is black, or reach or
                protect cannot be.
            DataError: a color is none, or the project's histogram of the object's colors is damaged.
        """
        palette, before = self._palette(name), self.added.get(name, ())
        if not 0 < reach <= MOST_REACH:
            raise BadRequest(f"{reach!r} is not a reach.", f"Give a number above 0, up to {MOST_REACH:g}.")
        if not 0 <= protect <= MOST_PROTECT:
            raise BadRequest(f"{protect!r} cannot be protected.", f"Give a number from 0 to {MOST_PROTECT:g}.")
        if len(before) == MOST_ADDED:
            raise BadRequest(f"{name!r} has {MOST_ADDED} added colors.", "Leave one of them out.")
        added = AddedColor(as_color(picked), float(reach), float(protect))
        seen = read_object_colors(self.project.checked(self.project.object_colors_file), name)
        colors = solve_set(seen, palette.colors, added, as_color(wanted, BRIGHTEST))
        return replace(
            self,
            colors=self.colors | {name: np.concatenate([self.colors[name], colors])},
            added=self.added | {name: (*before, added)},
        )

    @checked
    def swatch(self, name: str, index: int, color: Color) -> ProjectEdit:
        """Set one swatch of an object.

        Args:
            name: the object.
            index: which of its swatches, from 1; swatch 0 is black and frozen.
            color: the new color; numbers may go up to 2, brighter than white.

        Raises:
            BadRequest: there is no such object or swatch.
            DataError: the color is none.
        """
        colors = self.colors[self._palette(name).name].copy()
        self._check_swatch(self._palette(name), index)
        colors[index] = as_color(color, BRIGHTEST)
        return replace(self, colors=self.colors | {name: colors})

    @checked
    def edge(self, name: str, choke: float = 0.0, feather: float = 0.0) -> ProjectEdit:
        """Move and fade an object's edge, in pixels of the photos at their full size; both 0: as it is.

        On splats and points a pixel is a length: what it spans at the object, the median of the photos.

        Args:
            name: the object.
            choke: pixels by which its paint ends further inside, from -16 to 16; below 0 it goes beyond the object.
            feather: pixels over which it fades, half of them on either side, from 0 to 64.

        Raises:
            BadRequest: there is no such object, or a number is out of range.
        """
        shape = EdgeShape(float(choke), float(feather))
        return replace(self, edges=shaped_edges(self.edges | {self._palette(name).name: shape}))

    @checked
    def surface(
        self, name: str, index: int, saturation: float = 1.0, brightness: float = 0.0, gloss: float = 1.0
    ) -> ProjectEdit:
        """Give the paint of one swatch another surface, from how it looks now; other paints and added colors stay.

        Args:
            name: the object.
            index: which of its swatches, from 1.
            saturation: factor of the distance to gray, 0 to 4; 0 is gray.
            brightness: lifts or lowers the mid-tones, -2 to 2; black and white stay.
            gloss: factor of the highlights, 0 to 4; 0 is matte.

        Raises:
            BadRequest: there is no such object or swatch, or a value is out of range.
            DataError: the project's histogram of the object's colors is damaged.
        """
        surface, palette, edited = Surface(saturation, brightness, gloss), self._palette(name), self.colors[name]
        self._check_swatch(palette, index)
        (whole,), added = palettes_with([palette], self.added), self.added.get(name, ())
        seen = read_object_colors(self.project.checked(self.project.object_colors_file), name)
        seen = seen._replace(palette_weights=spread(seen.palette_weights.T, palette.colors, added).T)
        sets = range(len(palette.colors), len(edited))
        colors = match_surface(
            shown(seen, whole, edited), seen.counts, seen.palette_weights, edited, {index: surface}, sets
        )
        return replace(self, colors=self.colors | {name: colors})

    @checked
    def save(self, path: Path | str) -> None:
        """Write the edit, atomically: as JSON, or as the palette file of its suffix (`palettes.palette_files`)."""
        write_edit_file(Path(path), self)

    def _palette(self, name: str) -> Palette:
        for palette in self.palettes:
            if palette.name == name:
                return palette
        raise BadRequest(f"There is no object {name!r}.", f"Objects are: {', '.join(p.name for p in self.palettes)}.")

    def _check_swatch(self, palette: Palette, index: int) -> None:
        size = len(palette.colors)
        if not 1 <= index < size:
            raise BadRequest(f"{palette.name!r} has no swatch {index}.", f"Its swatches are 1 to {size - 1}.")


def edit_of(project: Project, path: Path | str | None = None) -> ProjectEdit:
    """An edit of a project that changes nothing yet, or that of a file.

    Raises:
        BadRequest: the project has no palettes.
        DataError: the palettes' file is damaged, or the edit's file is not an edit of them.
    """
    project.require("palette")
    palettes = read_palettes(project.checked(project.palette_file))
    compositing = from_dict(project.state()["settings"]).compositing
    edit = Edit({palette.name: palette.colors for palette in palettes}, compositing)
    if path is not None:
        edit = read_edit_file(Path(path), palettes, compositing)
    return ProjectEdit(edit.colors, edit.compositing, edit.added, edit.edges, project=project, palettes=palettes)


def solve(
    project: Project, palette: Palette, source: np.ndarray, target: np.ndarray, rule: str, is_metal: bool = False
) -> np.ndarray:
    """The edited palette [M, 3] with which colors `source` [P, 3] of the palette's object become `target` [P, 3], sRGB.

    Raises BadRequest for an unknown rule (see `RULES`) and for several colors by a rule that takes one, DataError where the
    histogram of the object's colors is damaged.
    """
    if rule not in RULES:
        raise BadRequest(f"Unknown rule {rule!r}.", f"Use one of: {', '.join(RULES)}.")
    colors, counts, weights = read_object_colors(project.checked(project.object_colors_file), palette.name)
    if rule == "becomes":
        return match_becomes(colors, counts, weights, palette.colors, source, target, is_metal=is_metal)
    if len(source) > 1:
        raise BadRequest("The rule 'fewest' takes one pair of colors.", "Use the rule 'becomes' for several.")
    return match_fewest(nearest_weights(colors, weights, source[0]), palette.colors, target[0], shown=source[0])


def as_color(value: Color, highest: float = 1.0) -> np.ndarray:
    """sRGB [3] float32 of `#rrggbb` or of three numbers from 0 to `highest`. Raises BadRequest or DataError for others."""
    if isinstance(value, str):
        return hex_to_rgb(value)
    color = np.asarray(value, np.float32)
    if color.shape != (3,) or not ((color >= 0) & (color <= highest)).all():
        raise BadRequest(
            f"{value!r:.200} is not a color.", f"Give #rrggbb, or three sRGB numbers from 0 to {highest:g}."
        )
    return color
