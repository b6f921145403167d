"""The distance to the truth, split by cause: each fault is found where it was made."""

from types import SimpleNamespace

import numpy as np
import pytest

from karf_engine.palettes.compositing import delta_composite
from karf_engine.palettes.palette import Edit, Palette
from tools.judging.causes import split_by_cause, split_in

RED, BLUE = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.2, 0.7])
LEARNED = np.array([np.zeros(3), RED])
SHADES = np.linspace(0.4, 1, 16 * 16).reshape(16, 16, 1)
INSIDE = np.ones((16, 16), bool)


def causes_of(to=BLUE, true=SHADES * BLUE, covered=1.0, photo=SHADES * RED, within=None):
    """An edit of a red thing that fills a view. within: the part of it that counts."""
    weights = covered * np.moveaxis(np.concatenate([1 - SHADES, SHADES], axis=2), 2, 0)[None]
    frame = SimpleNamespace(base=photo, palette_weights=weights)
    model = SimpleNamespace(
        palettes=[Palette("pot", LEARNED)],
        composite=lambda frame, edit: delta_composite(
            frame.base, frame.palette_weights, LEARNED[None], edit.colors["pot"][None]
        ),
    )
    truth = SimpleNamespace(
        edits={"blue": {"objects": ["pot"]}},
        masks=lambda split: {"pot": [INSIDE]},
        recolored=lambda edit: [true],
    )
    edit = Edit({"pot": np.array([np.zeros(3), to])})
    if within is None:
        found = split_by_cause(model, truth, [frame], edit, "blue")
    else:
        found = split_in(model, truth, [photo], [model.composite(frame, edit)], edit, "blue", [within])
    assert found["pot"] == found["all"]
    causes = found["all"]
    assert causes.ours == pytest.approx(causes.mask + causes.rule + causes.palette + causes.weights + causes.light)
    return causes


def test_a_right_edit_leaves_nothing():
    assert causes_of().ours < 0.5


def test_a_mask_that_covers_half_is_the_masks_fault():
    causes = causes_of(covered=0.5)
    assert causes.mask == pytest.approx(causes.ours, abs=0.5) and causes.ours > 10


def test_wrong_swatches_are_the_rules_fault():
    causes = causes_of(to=np.array([0.1, 0.7, 0.2]))
    assert causes.rule == pytest.approx(causes.ours, abs=0.5) and causes.ours > 10
    assert causes.bound < 0.5


def test_what_lies_beside_the_part_that_counts_is_nobodys_fault():
    left = np.broadcast_to(np.arange(16) < 8, (16, 16))
    true = SHADES * np.where(left[..., None], BLUE, [0.1, 0.7, 0.2])
    assert causes_of(true=true, within=left).ours < 0.5
    assert causes_of(true=true, within=~left).ours > 10


def test_colors_beside_the_palette_are_the_palettes_fault():
    mixed = np.linspace(0, 1, 16)[:, None, None]
    causes = causes_of(
        true=SHADES * BLUE * mixed, photo=SHADES * (RED * mixed + np.array([0.1, 0.6, 0.1]) * (1 - mixed))
    )
    assert causes.palette > 5


def test_one_color_that_becomes_two_is_the_lights_fault():
    halves = np.where(np.arange(16) < 8, 1.0, 0.5)[:, None, None]
    causes = causes_of(true=SHADES[::-1, ::-1] * halves * BLUE, photo=np.full((16, 16, 3), RED))
    assert causes.light > 5
