"""The extension's texts in other languages, one .po file each; `python -m tools.translations` lists what is missing."""

from pathlib import Path

import bpy

from ... import __package__ as extension
from .po_files import read_tables


def register():
    """Called when the extension is enabled."""
    bpy.app.translations.register(extension, read_tables(Path(__file__).parent))


def unregister():
    """Called when the extension is disabled."""
    bpy.app.translations.unregister(extension)
