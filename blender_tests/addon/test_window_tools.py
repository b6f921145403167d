"""The window stories of tools/, which no test runs, use only names that the extension has."""

import importlib
import re
from pathlib import Path

from .conftest import MODULE

FOLDER = Path(__file__).resolve().parents[2] / "tools" / "window"
USED = re.compile(r'module\("([\w.]+)"\)\.(\w+)')


def test_names_used_by_window_stories_exist(addon):
    texts = [path.read_text() for path in FOLDER.glob("*.py")]
    used = {found for text in texts for found in USED.findall(text)}
    assert ("tasks.runner", "is_running") in used and len(used) > 8
    assert sum(text.count("module(") for text in texts) == sum(len(USED.findall(text)) for text in texts) + 1
    modules = {name: importlib.import_module(f"{MODULE}.karf_blender.{name}") for name, _ in used}
    assert {(name, attribute) for name, attribute in used if not hasattr(modules[name], attribute)} == set()
