"""Sentences of errors and warnings in other languages, of the extension and the commonest of the engine, by their keys."""

from . import zh_hans

# languages by Blender's own names
TABLES = {"zh_HANS": zh_hans.TEXTS}
