"""Words that Blender translates: what it does not see by itself is marked or asked for here.

Labels, names and tooltips are translated where they are shown. Sentences with values in them are put together here,
after their translation. Sentences of errors and warnings stay English where they are raised, as in logs and reports to
developers, and as the engine says them; `translate_sentences` knows them again where they are shown.
`tools/translations.py` collects all of them from the sources.
"""

import re
from functools import lru_cache

from bpy.app.translations import pgettext_iface, pgettext_rpt

from ..translations import sentences


def translatable(text: str) -> str:
    """A text as it is, marked as one that is shown, and translated, elsewhere."""
    return text


def translate(text: str, **values: object) -> str:
    """A text of the interface in the user's language, with its values in their places."""
    translated = pgettext_iface(text)
    return translated.format(**values) if values else translated


def translate_report(text: str, **values: object) -> str:
    """The same for a report."""
    return pgettext_rpt(text).format(**values)


def translate_sentences(text: str) -> str:
    """Sentences of errors or warnings, put together in English, in the user's language.

    Those that are not known stay as they are. Values in them may be such sentences too; names are never translated.
    """
    translated = translate(text) if text else ""
    return translated if translated != text else _retranslated(text)


def _retranslated(text: str) -> str:
    for end in _ends(text):
        template, values = _known(text[:end])
        if template:
            first = translate(template).format(*map(_retranslated, values))
            return f"{first} {translate_sentences(text[end:].strip())}".strip()
    return text


def _ends(text: str) -> list[int]:
    """Where sentences may end."""
    return [*(found.start() + 1 for found in re.finditer(r"[.?] ", text)), len(text)]


@lru_cache(maxsize=256)
def _known(sentence: str) -> tuple[str, tuple[str, ...]]:
    """A sentence as the tables have it, and the values in it; empty where they have none."""
    for template, pattern in sentences.PATTERNS.items():
        match = pattern.fullmatch(sentence)
        if match:
            return template, match.groups()
    return "", ()
