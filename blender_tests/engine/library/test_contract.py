"""Every public function of the library accepts valid arguments and rejects invalid ones quickly, writing nothing."""

from __future__ import annotations

import faulthandler
import inspect
import os
import shutil
import signal
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
import torch

import karf_engine as karf
from blender_tests.engine.library.contract import OMITTED, kinds
from karf_engine import kan
from karf_engine.errors import KarfError
from karf_engine.kan import layers
from karf_engine.palettes.project_edit import ProjectEdit
from karf_engine.recolor.full_resolution import PhotoView

SECONDS = 10
RETURNED = {"ProjectEdit": ProjectEdit, "PhotoView": PhotoView}  # classes that public functions return
VALUES = ("PRESETS", "__version__", "kan.LAYERS", "kan.VARIANTS")  # not callable


def public_callables():
    """Pairs of name and callable: functions, classes, and the classes' methods."""
    public = {name: getattr(karf, name) for name in karf.__all__} | RETURNED
    public |= {f"kan.{name}": getattr(kan, name) for name in kan.__all__}
    for name, value in public.items():
        if name not in VALUES:
            yield name, value
        if inspect.isclass(value):
            for method, found in vars(value).items():
                is_method = callable(getattr(value, method)) and not isinstance(found, type)
                if is_method and not method.startswith("_"):
                    yield f"{name}.{method}", getattr(value, method)


CALLABLES = dict(public_callables())


@dataclass(frozen=True)
class Bench:
    """Kinds of arguments, objects whose methods are called, and a folder in which nothing may change."""

    folder: object
    kinds: dict
    subjects: dict

    def function(self, name):
        """The callable of a name; methods are bound to their object."""
        owner, _, method = name.rpartition(".")
        return getattr(self.subjects[owner], method) if owner in self.subjects else CALLABLES[name]

    def kinds_of(self, name):
        """The kind of each argument; keyword-only arguments of commands share the kind `options`."""
        found = {}
        function = name.removeprefix("kan.")
        for argument, item in inspect.signature(self.function(name)).parameters.items():
            places = [f"{function}.{argument}", f"{function.rpartition('.')[2]}.{argument}", argument]
            if item.kind is item.KEYWORD_ONLY:
                places[2] = "options"
            place = next((each for each in places if each in self.kinds), f"no kind of {name}.{argument}")
            found[argument] = self.kinds[place]
        return found

    def call(self, name, /, **invalid):
        """Call with valid arguments except these, and exhaust a generator."""
        given = {argument: known.valid for argument, known in self.kinds_of(name).items()} | invalid
        given = {argument: value for argument, value in given.items() if value is not OMITTED}
        function = self.function(name)
        known = inspect.signature(function).parameters.values()
        places = [given.pop(each.name) for each in known if each.kind is each.POSITIONAL_ONLY]
        result = function(*places, **given)
        return list(result) if inspect.isgenerator(result) else result


@pytest.fixture(scope="module")
def bench(still_life, learned, tmp_path_factory):
    folder = tmp_path_factory.mktemp("contract")
    for source, name in ((still_life.capture, "capture"), (still_life.masks, "masks"), (learned.project, "project")):
        shutil.copytree(source, folder / name)
    (folder / "sheet.csv").write_text("colorway,object,color\nblue,ball,#2030c0\n")
    (folder / "book.csv").write_text("name,hex\nRed,#ff0000\n")
    model = karf.load(folder / "project", device="cpu")
    model.edit().save(folder / "edit.json")
    view = model.capture.split("train")[0]
    subjects = {
        "Camera": view.camera.reduced(8),
        "Capture": model.capture,
        "ColorBook": karf.read_color_book(folder / "book.csv"),
        "Model": model,
        "ProjectEdit": model.edit(),
        "PhotoView": model.photo_view(view),
        "kan.BSplineLayer": kan.BSplineLayer(3, 2),
        "kan.GRBFLayer": kan.GRBFLayer(3, 2),
        "kan.GatedBlock": kan.GatedBlock(9, 0, 2, 2, width=4),
        "kan.MLPHead": kan.MLPHead(9, 0, 2, 2, width=4),
        "kan.MLPLayer": kan.MLPLayer(3, 2),
        "kan.Standardizer": kan.Standardizer(2),
    }
    return Bench(folder, kinds(folder, model), subjects)


@pytest.mark.parametrize("name", CALLABLES)
def test_valid_arguments_are_accepted(bench, name, monkeypatch):
    """Makes sure that a rejection below is due to the invalid argument."""
    monkeypatch.setattr("karf_engine.api.run_command", lambda *given, **more: None)
    if name == "learn":
        monkeypatch.setattr("karf_engine.api.load", lambda *given, **more: None)
    for known in ("LAYERS", "LAYER_KINDS"):  # forget the registered layer afterwards
        monkeypatch.setattr(f"karf_engine.kan.layers.{known}", copy(getattr(layers, known)))
    bench.call(name)
    for path in bench.folder.glob("new*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def misuses(bench, name):
    """Invalid arguments by name: one invalid value, two swapped values, or an unknown keyword."""
    known = bench.kinds_of(name)
    for argument, kind in known.items():
        yield from ({argument: value} for value in (*kind.invalid, *kind.accepted))
    given = [(argument, kind) for argument, kind in known.items() if kind.valid is not OMITTED]
    for (one, first), (other, second) in pairwise(given):
        are_numbers = type(first.valid) is type(second.valid) in (int, float)  # indistinguishable
        if first is not second and not are_numbers:
            yield {one: second.valid, other: first.valid}
    parameters = inspect.signature(bench.function(name)).parameters.values()
    if not any(each.kind is each.VAR_KEYWORD for each in parameters):
        yield {"unknown": 1}


@pytest.mark.parametrize("name", CALLABLES)
def test_invalid_arguments_are_rejected(bench, name, monkeypatch):
    monkeypatch.chdir(bench.folder)
    known, flaws = bench.kinds_of(name), []
    for invalid in misuses(bench, name):
        (argument, value), *others = invalid.items()
        may_be_accepted = not others and any(value is each for each in getattr(known.get(argument), "accepted", ()))
        ended = outcome(bench, name, invalid)
        if ended != "rejected" and not (ended == "accepted" and may_be_accepted):
            flaws.append(f"{invalid!r:.200}: {ended}")
    assert not flaws, "\n".join([f"{name}: {len(flaws)}", *flaws])


def outcome(bench, name, invalid):
    """How a call ends: `accepted`, `rejected`, or its flaw; a TypeError must name an invalid argument."""
    before = files(bench.folder)
    try:
        with alarm():
            result = bench.call(name, **invalid)
        ended = "accepted" if has_nan(result) or not any(map(has_nan, invalid.values())) else "a finite answer"
    except KarfError as error:
        ended = "rejected" if error.sentence and error.code != "internal" else f"traceback: {error!r}"
    except TypeError as error:
        is_named = any(argument in str(error) for argument in invalid)
        ended = "rejected" if is_named else f"traceback: {error!r:.300} does not name its argument"
    except TooSlow:
        ended = "hang"
    except Exception as error:
        ended = f"traceback: {error!r:.300}"
    return ended if files(bench.folder) == before else f"{ended}, but files changed"


def has_nan(value):
    if isinstance(value, karf.Frame):
        value = (value.base, value.probabilities, value.palette_weights)
    if isinstance(value, tuple | list):
        return any(map(has_nan, value))
    if isinstance(value, torch.Tensor):
        value = value.detach().numpy() if value.device.type == "cpu" else ()
    return isinstance(value, np.ndarray | float) and np.asarray(value).dtype.kind == "f" and np.isnan(value).any()


def files(folder):
    facts = ((path, path.stat()) for path in folder.rglob("*"))
    return {(path, stat.st_mtime_ns, 0 if path.is_dir() else stat.st_size) for path, stat in facts}


class TooSlow(BaseException):  # not an Exception, which the library may catch
    """The call took too long."""


@contextmanager
def alarm():
    """Stop a call that takes too long; end the process if no signal reaches it."""

    def ring(*_):
        raise TooSlow

    if os.name == "nt":  # without such a timer
        yield
        return
    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(SECONDS)
    faulthandler.dump_traceback_later(3 * SECONDS, exit=True)
    try:
        yield
    finally:
        signal.alarm(0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, before)
