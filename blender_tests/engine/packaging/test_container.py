"""The container's recipe, as far as it can be judged without building it."""

import json
import re

from blender_tests.engine.conftest import ROOT
from tools import dev

RECIPE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
LINES = re.sub(r"\\\n\s*", "", RECIPE).splitlines()


def instruction(name):
    return [line.removeprefix(name).strip() for line in LINES if line.startswith(f"{name} ")]


def test_it_installs_the_libraries_that_the_commands_ask_for():
    (install,) = (line for line in instruction("RUN") if "apt-get install" in line)
    assert set(dev.BLENDER_LIBRARIES.split()) == {word for word in install.split() if word.startswith("lib")}


def test_it_ends_in_the_two_commands_as_a_user_without_rights():
    (command,), (default,) = instruction("ENTRYPOINT"), instruction("CMD")
    assert json.loads(command) == ["python3", "tools/dev.py"]
    assert json.loads(default) == ["test"]
    assert instruction("USER") == ["karf"]
    assert LINES.index("USER karf") < LINES.index("RUN python3 tools/dev.py setup")


def test_what_the_environments_are_made_from_is_copied_before_they_are_made():
    copied = [line.split()[-2] for line in LINES[: LINES.index("RUN python3 tools/dev.py setup")] if "COPY" in line]
    assert copied == ["requirements/", "tools/dev.py"]
