"""Every text of the extension is translated with the same placeholders, and .po files are read and extended."""

import string

import pytest

from tools import translations


@pytest.fixture
def po(tmp_path):
    """Write a .po file and return its path."""

    def write(content):
        path = tmp_path / "xx.po"
        path.write_text(content, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("language", translations.languages())
def test_language_has_exactly_all_texts_and_placeholders(language):
    def placeholders(text):
        return sorted(name for _, name, _, _ in string.Formatter().parse(text) if name)

    assert translations.missing(language) == {} and translations.stale(language) == []
    for (_, text), translated in translations.table(language).items():
        assert translated.strip() and placeholders(text) == placeholders(translated), text


def test_shown_texts_and_error_sentences_are_found():
    assert translations.untranslatable() == []
    shown = {"Learn Scene", "3  Learn", "Skip Existing", "Photo plus change", "About a minute on this computer"}
    assert shown <= translations.texts().keys()
    sentences = {"The scene {name} has no capture.", "Import a capture first.", "The pictures are in {folder}."}
    sentences.add("{file} (edit planes) was made from other palettes.")
    assert sentences <= translations.sentences(translations.ROOT).keys()
    assert "{path} marks nothing of {name}." in translations.sentences(translations.ENGINE)


def test_po_file_is_read_like_gettext(po):
    path = po(
        'msgid ""\nmsgstr ""\n"Language: xx\\n"\n\n'
        '# of a translator\n#: a.py:1\nmsgid "Close"\nmsgstr "zu"\n\n'
        'msgctxt "Operator"\nmsgid "Close"\nmsgstr "schließen"\n\n'
        'msgid ""\n"Two lines\\n"\n"and \\"quotes\\""\nmsgstr "zwei\\n"\n"\\\\"\n\n'
        '#, fuzzy\nmsgid "Open"\nmsgstr "?"\n\nmsgid "New"\nmsgstr ""\n\n#~ msgid "Old"\n#~ msgstr "alt"\n'
    )
    close, quotes, lines = {("Operator", "Close"): "schließen"}, 'Two lines\nand "quotes"', "zwei\n\\"
    untranslated = {("", "Open"): "", ("", "New"): ""}
    assert translations.read_po(path) == close | untranslated | {("", "Close"): "zu", ("", quotes): lines}
    tables = {"xx": close | {("*", "Close"): "zu", ("*", quotes): lines, ("Operator", quotes): lines}}
    assert translations.po_files().read_tables(path.parent) == tables


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ('msgid "b"\n', "line 4: not an entry"),  # without a translation
        ("msgid b\nmsgstr c\n", "line 4: not an entry"),
        ('msgid "b\nmsgstr "c"\n', "line 4: not an entry"),
        ('text "b"\nmsgstr "c"\n', "line 4: not an entry"),
        ('msgid "\\q"\nmsgstr "c"\n', "line 4: .*escape"),
        ('msgid "a"\nmsgstr "c"\n', "line 4: 'a' is translated twice"),
    ],
)
def test_malformed_po_file_is_rejected_with_its_line(po, entry, reason):
    with pytest.raises(ValueError, match=f"xx.po, {reason}"):
        translations.read_po(po('msgid "a"\nmsgstr "b"\n\n' + entry))


def test_missing_texts_are_added_once_as_empty_entries(po, tmp_path):
    path = po('msgid "Learn Scene"\nmsgstr "lernen"\n')
    assert translations.add_missing("xx", path) == len(translations.all_texts()) - 1
    assert translations.add_missing("xx", path) == 0
    added = translations.read_po(path)
    assert added.keys() == {("", text) for text in translations.all_texts()}
    assert added["", "Learn Scene"] == "lernen" and set(added.values()) == {"lernen", ""}
    translations.add_missing("xx", tmp_path / "new.po")
    assert (tmp_path / "new.po").read_text().startswith('msgid ""\nmsgstr ""\n"Language: xx\\n"\n')
    assert not any(translations.read_po(tmp_path / "new.po").values())
