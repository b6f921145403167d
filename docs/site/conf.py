"""The documentation site: README.md, docs/*.md and the engine's docstrings, by Sphinx. `python3 tools/dev.py docs`."""

import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# the engine is imported to be described; its packages lie in the environment beside the one that builds
sys.path[:0] = [str(ROOT)]
sys.path.append(sysconfig.get_path("purelib", "venv", {"base": str(ROOT / ".venv" / "engine")}))

from karf_engine import __version__  # noqa: E402
from tools import reference  # noqa: E402

project, release = "KaRF", __version__
author = copyright = "KaRF for Blender contributors"
extensions = ["myst_parser", "sphinx.ext.apidoc", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
root_doc = "docs/index"
# the source folder is the checkout, so that links between README.md, docs/ and demo/ lead where they do there
include_patterns = ["*.md", "docs/*.md", "docs/tasks/*.md", "docs/api/*.rst"]
exclude_patterns = [
    ".*",
    "docs/api/modules.rst",
    "build",
    "demo",
    "dist",
    "karf_*",
    "blender_tests",
    "tools",
    "notebooks",
    "*_out",
    "shared",
]

apidoc_modules = [
    {
        "path": str(ROOT / "karf_engine"),
        "destination": "docs/api",
        "exclude_patterns": [str(ROOT / "karf_engine" / "__main__.py")],
        "module_first": True,
    }
]
autodoc_member_order = "bysource"
autodoc_inherit_docstrings = False  # those of torch refer to torch's own pages
autodoc_typehints = "signature"
autodoc_default_options = {"ignore-module-all": True}  # what a package exports is described where it is defined
suppress_warnings = ["ref.python"]  # a type in a docstring may be the name of several attributes
default_role = "code"  # docstrings write `name`, as Markdown does
smartquotes = False  # examples in docstrings keep their quotation marks
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # attributes of a dataclass are described once
myst_heading_anchors = 3

html_theme = "furo"
html_title = f"KaRF {release}"
html_extra_path = ["start"]
html_show_sourcelink = False


def setup(app):
    """Let the pages of the library and of the command line end with what the code itself says."""
    app.connect("source-read", _add_reference)


def _add_reference(app, name, source):
    texts = {"docs/library": reference.library, "docs/command_line": reference.command_line}
    if name in texts:
        source[0] += texts[name]()
