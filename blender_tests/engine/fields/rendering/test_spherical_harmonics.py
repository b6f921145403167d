"""Spherical harmonics of viewing directions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from karf_engine.fields.rendering.spherical_harmonics import spherical_harmonics


def test_spherical_harmonics_are_orthonormal_over_the_sphere():
    directions = torch.nn.functional.normalize(
        torch.randn(200_000, 3, generator=torch.Generator().manual_seed(0)), dim=1
    )
    basis = spherical_harmonics(directions)
    assert_allclose(4 * np.pi * (basis.T @ basis) / len(basis), np.eye(9), atol=0.02)
