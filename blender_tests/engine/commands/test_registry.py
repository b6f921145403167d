"""The registry of commands: every one has a module that runs it, and may be a job."""

import inspect
from importlib import import_module

import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

from karf_engine.commands.dispatch import run_command
from karf_engine.commands.options import COMMANDS, InspectOptions, LearnOptions, MarkOptions
from karf_engine.worker.protocol import STAGES, WARM


def test_every_command_is_run_in_the_same_way_and_may_be_a_job():
    for name in (name for name, kind in COMMANDS.items() if kind is not LearnOptions):
        run = import_module(f"karf_engine.commands.{name.replace('-', '_')}").run
        assert list(inspect.signature(run).parameters)[:3] == ["options", "emit", "should_stop"], name
    assert STAGES == (*COMMANDS, WARM)


def test_what_a_command_answers_is_returned(still_life, tmp_path, events):
    inspect_options = InspectOptions.of(capture=still_life.capture, out=tmp_path / "inspected")
    advice = run_command(inspect_options, events, lambda: False)
    assert advice.findings and (tmp_path / "inspected" / "inspection.json").exists()
    box = {"view": "train_r_0", "object_name": "ball", "box": (8, 8, 20, 20)}
    mark_options = MarkOptions.of(capture=still_life.capture, masks=tmp_path / "masks", **box)
    mask = run_command(mark_options, events, lambda: False)
    assert mask.is_file() and events.values("artifact", "path") == [str(tmp_path / "inspected"), str(mask)]
