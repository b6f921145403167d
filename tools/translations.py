"""List what the extension displays and no language translates yet: `python -m tools.translations [--add LANGUAGE]`.

Texts are found in the sources: labels and tooltips of classes, names and descriptions of properties, enum items, texts
of layouts, and what is marked by `host/words.py`. A text with values formatted into it cannot be translated, and is
listed too. Errors and warnings are templates beside their values; a translation of a text that neither the extension
nor the engine has any more is listed as well.

`--add` appends an empty entry for every missing text to the language's file; a new language gets a new file.
"""

from __future__ import annotations

import argparse
import ast
import json
import sys
from collections.abc import Iterator
from functools import cache
from importlib import util
from pathlib import Path
from types import ModuleType

from karf_engine.errors import PLACE
from karf_engine.project.settings import PRESETS

ROOT = Path(__file__).resolve().parents[1] / "karf_blender"
ENGINE = ROOT.with_name("karf_engine")
TABLES = ROOT / "translations"
HEADER = """msgid ""
msgstr ""
"Language: {language}\\n"
"Content-Type: text/plain; charset=UTF-8\\n"
"""
MARKS = ("translatable", "translate", "translate_report")
KEYWORDS = ("text", "title", "message", "heading")  # of calls, whose values are shown
PROPERTY_KEYWORDS = (*KEYWORDS, "name", "description")
POSITIONS = {"poll_message_set": 0, "need": 0, "_stage": 1, "report": 1, "draw_text": 1, "srgb": 0}
CLASS_TEXTS = ("bl_label", "bl_description")
CONSTANTS = ("_ITEMS", "_NAMES", "_HELP")  # ends of names of module constants that are shown
ERRORS = "KarfError BadRequest DataError MissingDependency NoSurface OutOfMemory Cancelled Diverged".split()
SENTENCES_AT = {**dict.fromkeys([*ERRORS, "Message"], (0, 1)), "warn": (0,)}  # which arguments are sentences
ENGLISH = ("steps/engine.py", "installer/*.py")  # files whose sentences are for programmers, or of installing
UNTRANSLATED = ("KaRF", "RGB", "RGBA", "PNG", "OpenEXR", "NeRF")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--add", metavar="LANGUAGE", help="as Blender names it, such as ja_JP")
    language = parser.parse_args().add
    if language:
        print(f"{add_missing(language, TABLES / f'{language}.po')} entries were added.")
        return 0
    faults = [f"{where}: {text!r} has values: give them beside it" for where, text in untranslatable()]
    for language in languages():
        faults += [f"{language}: {text!r} is missing ({where})" for text, where in missing(language).items()]
        faults += [f"{language}: {text!r} is displayed nowhere" for text in stale(language)]
    print("\n".join(faults) or "All texts are translated.")
    return 1 if faults else 0


def languages() -> list[str]:
    """Return the languages that have a file."""
    return sorted(path.stem for path in TABLES.glob("*.po"))


def add_missing(language: str, path: Path) -> int:
    """Append an empty entry for each text that a file lacks; return how many were added."""
    content = path.read_text(encoding="utf-8") if path.exists() else HEADER.format(language=language)
    known = read_po(path) if path.exists() else {}
    added = {text: where for text, where in all_texts().items() if ("", text) not in known}
    for text, where in added.items():
        content += f'\n#: {where}\nmsgid {json.dumps(text, ensure_ascii=False)}\nmsgstr ""\n'
    path.write_text(content, encoding="utf-8")
    return len(added)


def missing(language: str) -> dict[str, str]:
    """Return the texts that a language does not translate, and where they are."""
    translated = {text for (_, text), translation in table(language).items() if translation}
    return {text: where for text, where in all_texts().items() if text not in translated}


def stale(language: str) -> list[str]:
    """Return the texts in a language's file that are nowhere in the sources."""
    used = all_texts().keys() | sentences(ENGINE).keys() | _all_literals()
    return sorted({text for _, text in table(language)} - used)


def table(language: str) -> dict[tuple[str, str], str]:
    """Return a language's translations by context and text, read without Blender."""
    return read_po(TABLES / f"{language}.po")


def read_po(path: Path) -> dict[tuple[str, str], str]:
    """Return the translations of a .po file, as the extension reads them."""
    return po_files().read_po(path)


@cache
def po_files() -> ModuleType:
    """Return the extension's reader of .po files, whose package cannot be imported without Blender."""
    spec = util.spec_from_file_location("po_files", TABLES / "po_files.py")
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def all_texts() -> dict[str, str]:
    """Return all texts that a language has to translate, and where they are."""
    return texts() | sentences(ROOT)


def texts() -> dict[str, str]:
    """Return the texts of the interface that have letters, and where they are."""
    found = {name.capitalize(): "karf_blender/properties/scene.py" for name in PRESETS}
    found |= {text: where for where, node in _shown_nodes() for text in _literals(node)}
    return {text: where for text, where in found.items() if any(map(str.isalpha, text)) and text not in UNTRANSLATED}


def sentences(package: Path) -> dict[str, str]:
    """Return the keys of errors and warnings in the sources of a package, and where they are."""
    literals = ((where, node.value) for where, node in _sentence_nodes(package) if isinstance(node, ast.Constant))
    keys = {PLACE.sub(r"{\1}", str(text)): where for where, text in literals}
    return {key: where for key, where in keys.items() if any(map(str.isalpha, PLACE.sub("", key)))}


def _all_literals() -> set[str]:
    """Return all strings in the extension's sources: some texts are put in tables that are displayed elsewhere."""
    nodes = (node for _, node in _nodes(ROOT))
    return {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def _nodes(package: Path) -> Iterator[tuple[Path, ast.AST]]:
    """Yield each part of a package's sources, and its file."""
    for path in sorted(package.rglob("*.py")):
        yield from ((path, node) for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def _where(path: Path, node: ast.AST) -> str:
    return f"{path.relative_to(ROOT.parent)}:{node.lineno}"


def _sentence_nodes(package: Path) -> Iterator[tuple[str, ast.AST]]:
    """Places and expressions of the sentences of errors and warnings."""
    for path, node in _nodes(package):
        if isinstance(node, ast.Call) and not any(map(path.match, ENGLISH)):
            spoken = [node.args[at] for at in SENTENCES_AT.get(_name(node.func), ()) if at < len(node.args)]
            yield from ((_where(path, node), each) for argument in spoken for each in _alternatives(argument))


def untranslatable() -> list[tuple[str, str]]:
    """Places and sources of texts whose values are put in before they could be translated."""
    return [
        (where, ast.unparse(node))
        for where, shown in (*_shown_nodes(), *_sentence_nodes(ROOT))
        for node in _alternatives(shown)
        if isinstance(node, ast.JoinedStr) and _words(node)
    ]


def _words(node: ast.JoinedStr) -> bool:
    fixed = "".join(part.value for part in node.values if isinstance(part, ast.Constant))
    return any(map(str.isalpha, fixed.replace("KaRF", "")))


def _literals(node: ast.AST) -> Iterator[str]:
    """Return the displayed strings of an expression."""
    nodes = _alternatives(node)
    yield from (each.value for each in nodes if isinstance(each, ast.Constant) and isinstance(each.value, str))


def _alternatives(node: ast.AST) -> Iterator[ast.AST]:
    """An expression, or both of which it is one."""
    if isinstance(node, ast.IfExp):
        yield from (*_alternatives(node.body), *_alternatives(node.orelse))
    else:
        yield node


def _shown_nodes() -> Iterator[tuple[str, ast.AST]]:
    for path, node in _nodes(ROOT):
        if not path.match("steps/engine.py") and TABLES not in path.parents:
            yield from ((_where(path, each), each) for each in _of(node))


def _of(node: ast.AST) -> Iterator[ast.AST]:
    """The expressions that a part of a source shows."""
    if isinstance(node, ast.ClassDef):
        yield from _of_class(node)
    elif isinstance(node, ast.Call):
        yield from _of_call(node)
    elif isinstance(node, ast.Assign) and any(_name(each).endswith(CONSTANTS) for each in node.targets):
        yield from _of_items(node.value)
    elif isinstance(node, ast.Dict):
        known = dict(zip([getattr(key, "value", None) for key in node.keys], node.values, strict=True))
        yield from (known[key] for key in ("text", "bl_label") if key in known)


def _of_class(node: ast.ClassDef) -> Iterator[ast.AST]:
    named = [each for each in node.body if isinstance(each, ast.Assign) and _name(each.targets[0]) in CLASS_TEXTS]
    yield from (each.value for each in named)
    if named and isinstance(node.body[0], ast.Expr):
        yield node.body[0].value  # the tooltip


def _of_call(node: ast.Call) -> Iterator[ast.AST]:
    called = _name(node.func)
    if called in MARKS and isinstance(node.func, ast.Name):
        yield node.args[0]
        return
    keywords = PROPERTY_KEYWORDS if called.endswith("Property") or called == "srgb" else KEYWORDS
    yield from (each.value for each in node.keywords if each.arg in keywords)
    position = POSITIONS.get(called)
    if position is not None and len(node.args) > position:
        yield node.args[position]


def _of_items(node: ast.AST) -> Iterator[ast.AST]:
    """Of enum items the names and descriptions, of a dictionary the values."""
    if isinstance(node, ast.List | ast.Tuple):
        for item in node.elts:
            yield from item.elts[1:3] if isinstance(item, ast.Tuple) else ()
    elif isinstance(node, ast.Dict):
        yield from node.values


def _name(node: ast.AST) -> str:
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


if __name__ == "__main__":
    sys.exit(main())
