"""The library's contract: whatever is given, every public name answers or refuses in a sentence, soon, and writes nothing."""

from __future__ import annotations

import shutil
from copy import copy

import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

from blender_tests.engine.library.contract import (
    ROWS,
    Bench,
    arguments,
    callable_of,
    called,
    misuses,
    parameters,
    public_names,
)
from blender_tests.engine.library.watch import outcome
from karf_engine.kan import layers


@pytest.fixture(scope="module")
def bench(still_life, learned, tmp_path_factory) -> Bench:
    return Bench.of(still_life.capture, still_life.masks, learned.project, tmp_path_factory.mktemp("contract"))


def test_every_public_name_has_a_row():
    assert sorted(ROWS) == sorted(public_names())


@pytest.mark.parametrize("name", ROWS)
def test_every_argument_has_a_kind(bench, name):
    own = {each for each, item in parameters(callable_of(name, bench)).items() if item.kind is not item.KEYWORD_ONLY}
    assert own <= set(ROWS[name]) <= set(parameters(callable_of(name, bench)))


@pytest.mark.parametrize("name", ROWS)
def test_what_is_right_is_taken(bench, name, monkeypatch):
    """So that a refusal below is that of the one argument that is wrong."""
    monkeypatch.setattr("karf_engine.api.run_command", lambda *given, **more: None)
    monkeypatch.setattr("karf_engine.api.load", lambda *given, **more: None) if name == "learn" else None
    for known in ("LAYERS", "LAYER_KINDS"):  # a layer that is registered is forgotten again
        monkeypatch.setattr(f"karf_engine.kan.layers.{known}", copy(getattr(layers, known)))
    function = callable_of(name, bench)
    called(function, parameters(function), arguments(name, bench))
    for path in bench.folder.glob("new*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


@pytest.mark.parametrize("name", ROWS)
def test_what_is_wrong_is_refused_in_a_sentence(bench, name, monkeypatch):
    monkeypatch.chdir(bench.folder)
    flaws = []
    for misuse in misuses(name, bench):
        ended = outcome(lambda misuse=misuse: misuse.call(bench), misuse.names, bench.folder)
        if ended != "refused" and not (ended == "answered" and misuse.may_answer):
            flaws.append(f"{' and '.join(misuse.names)}, {misuse.what}: {ended}")
    assert not flaws, "\n".join([f"{name}: {len(flaws)}", *flaws])
