"""The registry of commands: every one has a module that runs it, and may be a job."""

import inspect
from importlib import import_module

import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

from karf_engine.commands.dispatch import run_command
from karf_engine.commands.options import COMMANDS, InspectOptions, LearnOptions, MarkOptions
from karf_engine.worker.protocol import STAGES, WARM


@pytest.mark.parametrize("name", [name for name, kind in COMMANDS.items() if kind is not LearnOptions])
def test_every_command_is_run_in_the_same_way(name):
    module = import_module(f"karf_engine.commands.{name.replace('-', '_')}")
    assert list(inspect.signature(module.run).parameters)[:3] == ["options", "emit", "should_stop"]


def test_every_command_may_be_a_job():
    assert STAGES == (*COMMANDS, WARM)


def test_what_a_command_answers_is_returned(still_life, tmp_path):
    events = []

    def run(options):
        return run_command(options, lambda kind, /, **values: events.append((kind, values)), lambda: False)

    advice = run(InspectOptions.of(capture=still_life.capture, out=tmp_path / "inspected"))
    assert advice.findings and (tmp_path / "inspected" / "inspection.json").exists()
    mask = run(
        MarkOptions.of(
            capture=still_life.capture,
            view="train_r_0",
            object_name="ball",
            masks=tmp_path / "masks",
            box=(8, 8, 20, 20),
        )
    )
    assert mask.is_file()
    assert [values["path"] for kind, values in events if kind == "artifact"] == [str(tmp_path / "inspected"), str(mask)]
