"""Fixtures of the engine's tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def scenes() -> Path:
    """Folder of real captures: KARF_SCENES, else shared/scenes beside the checkout; tests are skipped without it."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "scenes"
    folder = Path(os.environ.get("KARF_SCENES", beside))
    if not folder.is_dir():
        pytest.skip("no folder of real captures (set KARF_SCENES)")
    return folder
