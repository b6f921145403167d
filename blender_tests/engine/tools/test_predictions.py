"""What is predicted of an edit, beside what it is worth: where both see the same, they agree, and where not, they differ."""

from types import SimpleNamespace

import numpy as np
import pytest

from karf_engine.palettes.color_histogram import ColorHistogram
from karf_engine.palettes.compositing import delta_composite
from karf_engine.palettes.palette import Edit, Palette
from tools.judging import predictions

RED, BLUE = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.2, 0.7])
LEARNED = np.array([np.zeros(3), RED])
SHADES = np.linspace(0.4, 1, 16 * 16).reshape(16, 16, 1)
WEIGHTS = np.concatenate([1 - SHADES, SHADES], axis=2)


@pytest.fixture
def predicted(monkeypatch):
    """The row of a red thing that fills a view and becomes blue; covered: its masks' share of each pixel."""

    def row(covered=1.0, true=SHADES * BLUE):
        frame = SimpleNamespace(base=SHADES * RED, palette_weights=covered * np.moveaxis(WEIGHTS, 2, 0)[None])
        model = SimpleNamespace(
            palettes=[Palette("pot", LEARNED)],
            capture=SimpleNamespace(split=lambda split: ["view"]),
            preview=lambda view: frame,
            composite=lambda frame, edit: delta_composite(
                frame.base, frame.palette_weights, LEARNED[None], edit.colors["pot"][None]
            ),
            project=SimpleNamespace(verified=lambda file: file, object_colors_file="colors"),
        )
        truth = SimpleNamespace(
            edits={"blue": {"objects": ["pot"]}},
            masks=lambda split: {"pot": [np.ones((16, 16), bool)]},
            recolored=lambda edit: [true],
            color_pair=lambda edit, name: (RED, BLUE),
        )
        seen = ColorHistogram((SHADES * RED).reshape(-1, 3), np.ones(256), WEIGHTS.reshape(-1, 2))
        monkeypatch.setattr(predictions, "read_object_colors", lambda file, name: seen)
        edit = Edit({"pot": np.array([np.zeros(3), BLUE])})
        monkeypatch.setattr(predictions, "edit_to_judge", lambda model, truth, name: edit)
        (found,) = predictions.predictions(model, truth).values()
        return found

    return row


def test_in_the_photos_themselves_the_prediction_is_what_is_reached(predicted):
    row = predicted()
    assert row.left == pytest.approx(row.asked) and row.color == pytest.approx(row.in_views)
    assert row.true < 0.5


def test_what_masks_lose_is_not_predicted(predicted):
    row = predicted(covered=0.5)
    assert row.left < 2 and row.asked > 10 and row.in_views > 10


def test_what_new_light_does_is_not_predicted(predicted):
    row = predicted(true=SHADES * BLUE + 0.2)
    assert row.left == pytest.approx(row.asked) and row.true > 10


def test_gaps_are_absolute(predicted):
    row = predictions.PredictedAndReached(left=1.0, asked=3.0, true=0.5, color=0.0, in_views=0.0)
    found = predictions.gaps([row, row])
    assert found["left - asked"] == (2.0, 2.0) and found["left - true"] == (0.5, 0.5)
