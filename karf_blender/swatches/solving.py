"""Solving of swatches: functions from palettes to colors, without Blender.

Colors are sRGB in float32; swatch 0 is black and stays so. Behind the learned swatches follows the set of each added
color: first the color itself, then a hidden swatch for each learned one but black, which it moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..engine_api import (
    MAX_SRGB,
    AddedColor,
    BadRequest,
    ColorHistogram,
    Palette,
    Surface,
    add_fixed_paints,
    ciede2000,
    evaluate_edit,
    is_near,
    match_added_color,
    match_becomes,
    match_dragged,
    match_fewest,
    match_surface,
    mean_weights,
    nearest_weights,
    pigment_gate,
    propose_added_color,
    reached_color,
    residual_delta_e,
    rgb_to_hex,
    shown_colors,
    split_weights,
    srgb_to_lab,
    weighted_quantile,
)

HALF, MOST = 0.5, 0.95
FOREIGN = 10.0  # CIEDE2000 at and above: another color
LEAST_SHOWN = 1e-3  # share of an object's pixels; a rarer color is a stray one
UNREACHED = 0.05  # share of a pigment that added colors reach, up to which it is the learned swatches'
NEUTRAL = (1.0, 0.0, 1.0)  # saturation, brightness and gloss that change nothing


@dataclass(frozen=True, eq=False)
class PaletteState:
    """The M swatches of an object."""

    name: str
    learned: np.ndarray  # [M, 3]
    chosen: np.ndarray  # [M, 3], given by the artist
    shift: np.ndarray  # [M, 3], added to these by surfaces
    locked: np.ndarray  # [M] bool: no tool changes it
    link: np.ndarray  # [M] int: swatches of a scene with the same number have one color; 0: none
    merged: np.ndarray  # [M] int: number of the swatch that moves this one; 0: none
    is_added: np.ndarray  # [M] bool: the first of a set
    is_paint: np.ndarray  # [M] bool: the same, of a paint that was found and not picked
    by_paint: bool  # whether the colors given to paints count
    reach: np.ndarray  # [M], of an added color
    protect: np.ndarray  # [M], of an added color
    surface: np.ndarray  # [M, 3]: saturation, brightness, gloss
    is_metal: bool

    @property
    def size(self) -> int:
        """The number of learned swatches, black among them."""
        return int(self.is_added.argmax()) if self.is_added.any() else len(self.learned)

    @property
    def palette(self) -> Palette:
        """The palette as learned, without added colors."""
        return Palette(self.name, self.learned[: self.size])

    @property
    def whole(self) -> Palette:
        """The palette as learned, with the sets of added colors."""
        return Palette(self.name, self.learned)

    @property
    def edited(self) -> np.ndarray:
        """The displayed colors, [M, 3]: the chosen ones with what surfaces add; idle sets are as the learned swatches."""
        colors = np.clip(self.chosen + self.shift, 0, MAX_SRGB)
        return np.where(self.kept[:, None], colors, colors[np.arange(len(colors)) % self.size])

    @property
    def idle(self) -> np.ndarray:
        """Which swatches [M] bool begin the set of a paint that was given nothing: it has no weight."""
        is_own = (self.chosen != self.learned).any(axis=1) | (self.surface != NEUTRAL).any(axis=1)
        return self.is_paint & ~(is_own & self.by_paint)

    @property
    def kept(self) -> np.ndarray:
        """Which swatches [M] bool an edit has: all but the idle sets."""
        numbers = np.arange(len(self.learned))
        return ~self.idle[numbers - numbers % self.size]

    @property
    def held(self) -> list[int]:
        """The numbers of swatches that no solve may move: locked, merged and added ones."""
        return np.flatnonzero(self.locked | (self.merged > 0) | self.is_added).tolist()

    @property
    def added(self) -> tuple[AddedColor, ...]:
        """The added colors."""
        return tuple(self.added_color(index) for index in np.flatnonzero(self.is_added))

    @property
    def is_neutral(self) -> bool:
        """True if no swatch has a surface; those of merged ones do not count."""
        return bool((self.surface[self.merged == 0] == NEUTRAL).all())

    @property
    def key(self) -> bytes:
        """All that shifts depend on, and the shifts, as one comparable value."""
        arrays = (self.learned, self.chosen, self.shift, self.locked, self.merged, self.is_added)
        return b"".join(each.tobytes() for each in (*arrays, self.reach, self.protect, self.surface, self.idle))

    def added_color(self, index: int) -> AddedColor:
        """Return the added color of the set beginning at a swatch; an idle one reaches nothing."""
        reach = 0.0 if self.idle[index] else float(self.reach[index])
        return AddedColor(self.learned[index], reach, float(self.protect[index]))

    def surface_of(self, index: int) -> Surface:
        """Return the surface of a swatch."""
        return Surface() if self.merged[index] else Surface(*self.surface[index].tolist())

    def with_colors(self, chosen: np.ndarray) -> "PaletteState":
        """Return the same with other chosen colors."""
        return replace(self, chosen=np.clip(chosen, 0, MAX_SRGB).astype(np.float32))

    def spread(self, histogram: ColorHistogram) -> ColorHistogram:
        """Return the object's colors in the photos, with weights spread over the sets of added colors."""
        weights = split_weights(histogram.palette_weights.T, self.palette.colors, self.added)
        return histogram._replace(palette_weights=weights.T)

    def gathered(self, weights: np.ndarray) -> np.ndarray:
        """Return weights [M, ...] with those of merged swatches given to the ones that move them; sets stay."""
        weights = weights.copy()
        for index in np.flatnonzero((self.merged > 0)[: self.size] & ~self.locked[: self.size]):
            weights[self.merged[index]] += weights[index]
            weights[index] = 0
        return weights

    def visible(self, histogram: ColorHistogram, palette: np.ndarray) -> np.ndarray:
        """Return the object's colors [n, 3] with another palette [M, 3]."""
        return shown_colors(histogram, self.whole, palette)


States = dict[str, PaletteState]  # of a scene's objects, by name


# --- swatches that move together -----------------------------------------------------------------------------------
def linked(states: States, name: str, index: int) -> dict[str, np.ndarray]:
    """Return which swatches [M] bool are linked to one, itself among them, of each object that has some."""
    link, found = states[name].link[index], {}
    for each, state in states.items():
        own = (state.link == link) & (link > 0)
        own[index if each == name else 0] |= each == name
        if own.any():
            found[each] = own
    return found


def assign(states: States, name: str, index: int, color: Sequence[float] | np.ndarray) -> States:
    """Return the states after a swatch was given a color: linked ones take it, merged ones change alike."""
    result = dict(states)
    for each, own in linked(states, name, index).items():
        state = states[each]
        takes = own & ~state.locked
        takes[index if each == name else 0] |= each == name
        chosen = np.where(takes[:, None], np.float32(color), state.chosen)
        result[each] = _carry(state.with_colors(chosen), own)
    return result


def reset(states: States, name: str, index: int) -> tuple[States, dict[str, np.ndarray]]:
    """Return the states with a swatch and all that move with it as learned, and which [M] bool these are."""
    result, masks = dict(states), {}
    for each, own in linked(states, name, index).items():
        state = states[each]
        masks[each] = (own | ((state.merged > 0) & own[state.merged])) & ~state.locked
        result[each] = state.with_colors(np.where(masks[each][:, None], state.learned, state.chosen))
    return result, masks


def _carry(state: PaletteState, leaders: np.ndarray) -> PaletteState:
    """Change the swatches merged into others [M] bool by as much as these; sets are solved instead."""
    moves = (state.merged > 0) & ~state.locked & leaders[state.merged] & ~state.is_added[state.merged]
    learned, chosen = state.learned.astype(np.float64), state.chosen.astype(np.float64)
    moved = learned + (chosen - learned)[state.merged]
    return state.with_colors(np.where(moves[:, None], moved, state.chosen))


# --- added colors --------------------------------------------------------------------------------------------------
def solve_set(state: PaletteState, index: int, histogram: ColorHistogram) -> PaletteState:
    """Return the state with an added color's set solved by a histogram as learned. Raises BadRequest for black."""
    color, chosen = state.added_color(index), state.chosen.copy()
    found = state.learned[index : index + state.size]
    if color.reach:
        found = match_added_color(histogram, state.palette.colors, color, state.chosen[index])
    chosen[index : index + len(found)] = found
    return state.with_colors(chosen)


def first_set(state: PaletteState, color: AddedColor, histogram: ColorHistogram) -> np.ndarray:
    """Return the set [M, 3] of a new added color; it changes no picture.

    Where added colors reach its pigment already, it is solved, as whenever it moves. Raises BadRequest for black.
    """
    own = mean_weights(*state.spread(histogram), color.picked)
    looks = np.clip(color.picked + own @ (state.edited - state.learned), 0, 1).astype(np.float32)
    solved = match_added_color(histogram, state.palette.colors, color, looks)
    is_reached = own[state.size :].sum() > UNREACHED
    return solved if is_reached else np.array([looks, *state.edited[1 : state.size]])


def paint_at(state: PaletteState, seen: ColorHistogram, color: np.ndarray) -> tuple[int, AddedColor]:
    """Return the number of the added color that a learned color [3] belongs to; 0 without one, and what to add."""
    ready = replace(state, is_paint=np.zeros_like(state.is_paint))
    for index in reversed(np.flatnonzero(state.is_added)):
        added = ready.added_color(index)
        if pigment_gate(color[None], added.picked, added.reach, added.protect)[0] > HALF:
            return int(index), added
    return 0, propose_added_color(seen, color)


def moved_elsewhere(state: PaletteState, seen: ColorHistogram) -> float:
    """Return the CIEDE2000 that 95 % of the colors of unchanged paints stay below, by a histogram as learned."""
    gates = [pigment_gate(seen.colors, each.picked, each.reach, each.protect) for each in state.added if each.reach]
    is_other = np.max([np.zeros(len(seen.colors)), *gates], axis=0) < HALF
    if not is_other.any():
        return 0.0
    after = state.visible(state.spread(seen), state.edited)
    moved = ciede2000(srgb_to_lab(seen.colors), srgb_to_lab(after))[is_other]
    return weighted_quantile(moved, seen.counts[is_other], MOST)


# --- Material ------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Gesture:
    """A drag of swatches of an object, which knows the object's colors at its start."""

    moved: tuple[int, ...]  # linked ones are dragged at once
    start: np.ndarray  # [M, 3]
    result: np.ndarray  # [M, 3] after its last change

    def continues(self, moved: Sequence[int], chosen: np.ndarray) -> bool:
        """True if these are the swatches, and no other has changed since but those that followed."""
        others = ~np.isin(np.arange(len(chosen)), moved)
        is_same = tuple(moved) == self.moved and len(chosen) == len(self.result)
        return is_same and bool((chosen[others] == self.result[others]).all())


def drag(state: PaletteState, gesture: Gesture, histogram: ColorHistogram) -> PaletteState:
    """Return the state after a drag: the other swatches of the paint follow those dragged.

    Locked swatches and added colors stay. `histogram` has the object's colors with the sets of added colors.
    """
    weights, numbers = state.gathered(histogram.palette_weights.T).T, np.arange(len(state.chosen))
    colors = gesture.start
    for index in gesture.moved:
        stays = [*state.held, *(each for each in gesture.moved if each != index)]
        visible, wanted = state.visible(histogram, colors), state.chosen[index]
        colors = match_dragged(visible, histogram.counts, weights, colors, index, wanted, stays, state.is_metal)
    stays = np.isin(numbers, [*gesture.moved, *state.held])
    return _carry(state.with_colors(np.where(stays[:, None], state.chosen, colors)), numbers < state.size)


# --- surfaces ------------------------------------------------------------------------------------------------------
def surface_shifts(state: PaletteState, histogram: ColorHistogram | None) -> np.ndarray:
    """Return what surfaces add to the chosen colors, [M, 3], by a histogram with sets; a neutral state needs none."""
    chosen, numbers = state.chosen, np.arange(len(state.chosen))
    # locked swatches with a neutral surface stay as displayed
    held = [index for index in numbers[state.locked] if state.surface_of(index).is_neutral]
    kept = np.where(np.isin(numbers, held)[:, None], state.shift, np.float32(0))
    if state.is_neutral:
        return kept
    if histogram.palette_weights.shape[1] != len(chosen):  # the project has learned others since
        return state.shift
    visible, shifts = state.visible(histogram, chosen), np.zeros_like(chosen)
    for first in range(0, len(chosen), state.size):
        is_own = (numbers >= first) & (numbers < first + state.size)
        surfaces = {index: state.surface_of(index) for index in numbers[is_own].tolist()}
        pinned = [*numbers[~is_own], *(index for index in surfaces if index in held)]
        known = visible, histogram.counts, histogram.palette_weights
        shifts += match_surface(*known, chosen, surfaces, pinned, kept * is_own[:, None]) - chosen
    return shifts


# --- one color becomes another -------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Becoming:
    """A color of an object, and what it becomes."""

    source: np.ndarray  # sRGB [3], in the mean exposure of all photos
    target: np.ndarray  # sRGB [3]
    rule: str  # "becomes": the whole object; "paint": this paint alone; "fewest": as few swatches as possible
    start: np.ndarray  # [M, 3], the palette of the picture that shows the source
    held: Sequence[np.ndarray] = ()  # colors that other paints of the object were given with `start` and keep


def become(state: PaletteState, pair: Becoming, histogram: ColorHistogram) -> tuple[np.ndarray, str]:
    """Return the palette [M, 3] that makes one color another, and why it misses. Raises BadRequest if none is like it."""
    held = state.held
    start = np.where(np.isin(np.arange(len(state.chosen)), held)[:, None], state.edited, pair.start)
    visible = state.visible(histogram, start)
    check_shown(state, visible, histogram.counts, pair.source)
    weights = state.gathered(histogram.palette_weights.T).T
    if pair.rule == "fewest":
        nearest = nearest_weights(visible, weights, pair.source)
        edited = match_fewest(nearest, start, pair.target, held, shown=pair.source)
    else:
        paints = add_fixed_paints(visible, pair.source, pair.target, pair.held)
        edited = match_becomes(visible, histogram.counts, weights, start, *paints, held, state.is_metal)
    before, target = ColorHistogram(visible, histogram.counts, weights), srgb_to_lab(pair.target)
    reached, _, reason = evaluate_edit(edited, start, before, pair.source, target, held)
    missed = f"{state.name} shows {rgb_to_hex(reached)} and not quite what was wanted, because {reason}."
    return edited, missed if reason else ""


def learned_source(state: PaletteState, pair: Becoming, histogram: ColorHistogram) -> np.ndarray:
    """Return what the source color of a pair is as learned, sRGB [3]. Raises BadRequest if the object shows no such."""
    visible = state.visible(histogram, pair.start)
    check_shown(state, visible, histogram.counts, pair.source)
    alike = is_near(visible, pair.source)
    moved = np.average(visible[alike] - histogram.colors[alike], axis=0, weights=histogram.counts[alike] + 1e-9)
    return np.clip(pair.source - moved, 0, 1)


def check_shown(state: PaletteState, visible: np.ndarray, counts: np.ndarray, color: np.ndarray) -> None:
    """Raise BadRequest if an object that shows these colors [n, 3], so often [n], shows none like a color [3]."""
    if not is_shown(visible, counts, color):
        raise BadRequest(
            "{name} shows no color like {color}.",
            "Pick the left color on the object in the displayed picture.",
            name=state.name,
            color=rgb_to_hex(color),
        )


def is_shown(colors: np.ndarray, counts: np.ndarray, color: np.ndarray) -> bool:
    """True if a color [3] is one of an object that shows `colors` [n, 3] so often, [n]."""
    alike = ciede2000(srgb_to_lab(colors), srgb_to_lab(color)) <= FOREIGN
    return bool(counts[alike].sum() > LEAST_SHOWN * counts.sum())


def left_to_target(state: PaletteState, pair: Becoming, histogram: ColorHistogram) -> float:
    """Return the mean CIEDE2000 of the whole object to where the source color has become the target.

    By the rules of one paint and of fewest swatches only the color itself is to be met. Infinity where the object shows
    no such source.
    """
    before, after = (state.visible(histogram, palette) for palette in (pair.start, state.edited))
    if not is_shown(before, histogram.counts, pair.source):
        return np.inf
    if pair.rule != "becomes":
        reached = reached_color(before, after, pair.source, histogram.counts)
        return float(ciede2000(srgb_to_lab(reached), srgb_to_lab(pair.target)))
    return residual_delta_e(before, after, histogram.counts, pair.source, pair.target, pair.held, state.is_metal)
