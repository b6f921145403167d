"""Fixtures that ask queries about the learned still life."""

import numpy as np
import pytest

from karf_engine.palettes.palette import edit_to_json
from karf_engine.recolor.model import Model
from karf_engine.worker.queries import QUERIES
from karf_engine.worker.queries.session import Session


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project)


@pytest.fixture(scope="module")
def edit(model):
    return model.edit().swatch("ball", 1, (0.1, 0.2, 0.9))


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path, threads=1, device="cpu")


@pytest.fixture
def ask(session, learned, edit):
    """Ask a query about the learned project with the edit, unless the options say otherwise."""

    defaults = {"project": str(learned.project), "edit": edit_to_json(edit)}
    return lambda kind, **options: QUERIES[kind](session, defaults | options)


def with_arrays(answer):
    """An answer and its arrays by name."""
    arrays = {}
    for name, placed in answer["arrays"].items():
        count = int(np.prod(placed["shape"]))
        array = np.fromfile(answer["pixels"], placed["dtype"], count, offset=placed["offset"])
        arrays[name] = array.reshape(placed["shape"])
    return answer, arrays
