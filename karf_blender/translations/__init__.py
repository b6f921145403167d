"""The extension's words in other languages, as Blender takes them; `python -m tools.translations` lists what is missing."""

import bpy

from ... import __package__ as extension
from .. import session
from . import sentences, zh_hans

# languages by Blender's own names
TABLES = {"zh_HANS": zh_hans.TEXTS | sentences.TABLES["zh_HANS"]}
CONTEXTS = ("*", "Operator")  # in which Blender looks for texts, and for labels of operators


@session.setup
def _words():
    words = {
        language: {(context, text): translated for text, translated in table.items() for context in CONTEXTS}
        for language, table in TABLES.items()
    }
    bpy.app.translations.register(extension, words)
    yield
    bpy.app.translations.unregister(extension)
