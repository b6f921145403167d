"""The engine on another computer: a small program in the place of the engine's Python, and a stand-in for ssh."""

import os
import time
from pathlib import Path

import pytest

from blender_tests.addon.conftest import ENGINE_PYTHON, ROOT

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the stand-ins are scripts with a first line")
SSH = '#!/bin/sh\ncd / && exec sh -c "$5"\n'
THERE = """#!/bin/sh
while [ "$1" != run ]; do shift; done
PYTHONPATH={root} exec {python} -m karf_engine "$@"
"""
PROGRAM = """#!/bin/sh
export PYTHONPATH={root}
exec {python} -m karf_engine.remote gpu --python {there} --map "{client}={server}" -- "$@"
"""


@pytest.fixture
def program(tmp_path, monkeypatch):
    """What *Engine Python* is set to; tmp_path/client is called tmp_path/server there."""
    python = Path(ENGINE_PYTHON or ROOT / ".venv" / "engine" / "bin" / "python")
    if not python.is_file():
        pytest.skip("no engine")
    (tmp_path / "server").mkdir()
    (tmp_path / "client").symlink_to(tmp_path / "server", target_is_directory=True)
    names = {"root": ROOT, "python": python, "client": tmp_path / "client", "server": tmp_path / "server"}
    for name, text in (("ssh", SSH), ("there", THERE), ("program", PROGRAM)):
        (tmp_path / name).write_text(text.format(there=tmp_path / "there", **names))
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    return tmp_path / "program"


def test_a_job_there_is_a_job_as_any_other(addon, program, tmp_path, monkeypatch):
    monkeypatch.setenv("KARF_ENGINE_PYTHON", str(program))
    assert addon.preferences.engine_python() == program
    project = tmp_path / "client" / "pots_karf"
    request = addon.engine_api.Request("render", project, {"views": "test", "out": str(tmp_path / "client" / "frames")})
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", ROOT / "karf_engine")
    worker = addon.worker.Worker()
    worker.begin(program, request, tmp_path / "client" / "job")
    deadline = time.monotonic() + 120
    events = []
    while not worker.ended:
        events += worker.poll()
        assert time.monotonic() < deadline, "the job does not end"
        time.sleep(0.02)
    assert events[0].kind == "hello", addon.failures.log_tail(worker.folder)
    with pytest.raises(addon.engine_api.DataError, match="is not a KaRF project") as caught:
        worker.check()
    assert str(project) in caught.value.sentence
