"""Read translations from gettext's .po files, one for each language; plural forms are not supported. No bpy."""

import json
import re
from pathlib import Path

CONTEXTS = ("*", "Operator")  # of Blender: all texts, and labels of operators
STRINGS = r'(?:"(?:[^"\\\n]|\\.)*"\s*)+'
ENTRY = re.compile(rf"(?:msgctxt (?P<context>{STRINGS}))?msgid (?P<text>{STRINGS})msgstr (?P<translation>{STRINGS})")
COMMENTS = re.compile(r"(?:#.*\n|\s+)*")


def read_tables(folder: Path) -> dict[str, dict[tuple[str, str], str]]:
    """Return the languages of a folder for `bpy.app.translations.register`; `ja_JP.po` translates to ja_JP."""
    return {path.stem: _table(read_po(path)) for path in sorted(folder.glob("*.po"))}


def read_po(path: Path) -> dict[tuple[str, str], str]:
    """Return translations by context and text: "" is no context, and an empty or fuzzy translation.

    Raises:
        ValueError: An entry is malformed or comes twice; the message names its line.
    """
    content = path.read_text(encoding="utf-8") + "\n"
    translations: dict[tuple[str, str], str] = {}
    comments = COMMENTS.match(content)
    while comments.end() < len(content):
        where = f"{path.name}, line {content.count(chr(10), 0, comments.end()) + 1}"
        entry = ENTRY.match(content, comments.end())
        if entry is None:
            raise ValueError(f"{where}: not an entry of msgctxt, msgid and msgstr")
        try:
            context, text, translation = map(_unquote, entry.groups(default='""'))
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from error
        if (context, text) in translations:
            raise ValueError(f"{where}: {text!r} is translated twice")
        is_fuzzy = re.search(r"^#,.*\bfuzzy\b", comments[0], re.MULTILINE)
        translations[context, text] = "" if is_fuzzy else translation
        comments = COMMENTS.match(content, entry.end())
    translations.pop(("", ""), None)  # the header
    return translations


def _unquote(strings: str) -> str:
    return "".join(json.loads(line) for line in strings.split("\n") if line.strip())


def _table(translations: dict[tuple[str, str], str]) -> dict[tuple[str, str], str]:
    table = {}
    for (context, text), translation in sorted(translations.items()):  # without a context first: others override it
        if translation:
            table.update({(each, text): translation for each in ([context] if context else CONTEXTS)})
    return table
