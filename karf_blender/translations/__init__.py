"""The extension's texts in other languages, one .po file each; `python -m tools.translations` lists what is missing."""

from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import session
from .po_files import read_tables


@session.setup
def _translations():
    bpy.app.translations.register(extension, read_tables(Path(__file__).parent))
    yield
    bpy.app.translations.unregister(extension)
