"""Paints that a seed draws, and what they are repainted with (numpy and the standard library only)."""

from __future__ import annotations

import colorsys

import numpy as np

from .scene import Color, Paint

# saturation and value, least and most, scene linear
KINDS = {
    "vivid": ((0.75, 0.95), (0.30, 0.65)),
    "dark": ((0.50, 0.90), (0.04, 0.12)),
    "pale": ((0.15, 0.40), (0.50, 0.75)),
    "earthy": ((0.40, 0.65), (0.15, 0.35)),
}
KIND_SHARES = (0.45, 0.15, 0.15, 0.25)
PATTERNS, PATTERN_SHARES = ("plain", "bands", "checks", "clouds", "rise"), (0.52, 0.12, 0.12, 0.12, 0.12)
ROUGHNESSES = (0.08, 0.2, 0.35, 0.5, 0.8)
TRANSLUCENT_SHARE, TRANSLUCENCY = 0.12, 0.4
LIKE_HUE = 0.03  # by which the hues of neighbors that mislead differ, at most; a turn is 1


def draw_paint(rng: np.random.Generator) -> Paint:
    """Return any paint."""
    pattern = str(rng.choice(PATTERNS, p=PATTERN_SHARES))
    colors = tuple(_draw_color(rng) for _ in range(1 if pattern == "plain" else 2))
    translucency = TRANSLUCENCY if pattern == "plain" and rng.random() < TRANSLUCENT_SHARE else 0.0
    return Paint(colors, pattern, float(rng.choice(ROUGHNESSES)), translucency)


def like(paint: Paint, rng: np.random.Generator) -> Paint:
    """Return a plain paint of nearly the main hue of another, somewhat darker or lighter."""
    hue, saturation, value = colorsys.rgb_to_hsv(*paint.colors[0])
    hue += rng.uniform(-LIKE_HUE, LIKE_HUE)
    color = colorsys.hsv_to_rgb(hue % 1, saturation, min(value * rng.uniform(0.7, 1.4), 0.8))
    return Paint((color,), "plain", float(rng.choice(ROUGHNESSES)))


def repainted(color: Color, turn: float, brightness: float) -> Color:
    """Return a color of another hue: ``turn`` (1 is all round) and ``brightness`` (a factor) say which."""
    hue, saturation, value = colorsys.rgb_to_hsv(*color)
    return colorsys.hsv_to_rgb((hue + turn) % 1, max(saturation, 0.5), float(np.clip(value * brightness, 0.05, 0.75)))


def draw_repaints(paints: dict[str, Paint], rng: np.random.Generator) -> dict[str, dict[str, tuple[Color, ...]]]:
    """Return two edits of things with these paints: the main color of the first thing, and all colors of all."""
    turns = {name: (rng.uniform(0.25, 0.75), rng.uniform(0.6, 1.6)) for name in paints}
    first, paint = next(iter(paints.items()))
    main = repainted(paint.colors[0], rng.uniform(0.25, 0.75), rng.uniform(0.6, 1.6))
    every = {name: tuple(repainted(each, *turns[name]) for each in paints[name].colors) for name in paints}
    return {"first": {first: (main, *paint.colors[1:])}, "all": every}


def _draw_color(rng: np.random.Generator) -> Color:
    saturation, value = KINDS[str(rng.choice(tuple(KINDS), p=KIND_SHARES))]
    return colorsys.hsv_to_rgb(rng.random(), rng.uniform(*saturation), rng.uniform(*value))
