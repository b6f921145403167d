"""Color science against published tables."""

from __future__ import annotations

import numpy as np
import pytest

from karf_engine import color


@pytest.mark.parametrize(
    ("srgb", "lab"),
    [  # published Lab values of the sRGB primaries (D65, 2 degrees)
        ([1, 1, 1], [100, 0, 0]),
        ([0, 0, 0], [0, 0, 0]),
        ([1, 0, 0], [53.24, 80.09, 67.20]),
        ([0, 1, 0], [87.73, -86.18, 83.18]),
        ([0, 0, 1], [32.30, 79.19, -107.86]),
    ],
)
def test_lab_of_primaries_is_as_published(srgb: list[float], lab: list[float]) -> None:
    np.testing.assert_allclose(color.srgb_to_lab(np.array(srgb, float)), lab, atol=0.01)


def test_srgb_curve_has_its_published_points_and_inverts() -> None:
    # 0.5 -> 0.2140; the linear piece ends at 0.04045 / 12.92
    np.testing.assert_allclose(color.srgb_to_linear([0, 0.04045, 0.5, 1]), [0, 0.0031308, 0.2140411, 1], atol=1e-7)
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(color.linear_to_srgb(color.srgb_to_linear(values)), values, atol=1e-7)
