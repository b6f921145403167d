"""What the stories in a window ask the extension for is there: they run in no test."""

import importlib
import re
from pathlib import Path

from .conftest import MODULE

FOLDER = Path(__file__).resolve().parents[2] / "tools" / "window"
ASKED = re.compile(r'module\("([\w.]+)"\)\.(\w+)')


def test_modules_have_what_the_stories_use(addon):
    texts = [path.read_text() for path in FOLDER.glob("*.py")]
    asked = {found for text in texts for found in ASKED.findall(text)}
    assert ("tasks.runner", "is_running") in asked and len(asked) > 8
    assert sum(text.count("module(") for text in texts) == sum(len(ASKED.findall(text)) for text in texts) + 1
    modules = {name: importlib.import_module(f"{MODULE}.karf_blender.{name}") for name, _ in asked}
    assert {(name, attribute) for name, attribute in asked if not hasattr(modules[name], attribute)} == set()
