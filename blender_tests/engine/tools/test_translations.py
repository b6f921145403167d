"""All that the extension shows is translated, and translated as it is filled in."""

import string

import pytest

from tools import translations


@pytest.fixture
def po(tmp_path):
    """Write the file of a language."""

    def write(content):
        path = tmp_path / "xx.po"
        path.write_text(content, encoding="utf-8")
        return path

    return write


def test_sentences_with_values_can_be_translated():
    assert translations.untranslatable() == []


@pytest.mark.parametrize("language", translations.languages())
def test_a_language_has_every_text(language):
    assert translations.missing(language) == {}


@pytest.mark.parametrize("language", translations.languages())
def test_a_language_has_no_text_that_is_displayed_nowhere(language):
    assert translations.stale(language) == []


@pytest.mark.parametrize("language", translations.languages())
def test_a_translation_has_the_places_of_the_values(language):
    def places(text):
        return sorted(name for _, name, _, _ in string.Formatter().parse(text) if name)

    for (_, text), translated in translations.table(language).items():
        assert translated.strip() and places(text) == places(translated), text


def test_what_is_shown_is_found():
    found = translations.texts().keys()
    assert {
        "Learn Scene",
        "2  Learn Scene",
        "Skip Existing",
        "Photo plus change",
        "About a minute on this computer",
    } <= found


def test_sentences_of_errors_are_found_with_places_for_their_values():
    assert {
        "The scene {name} has no capture.",
        "Import a capture first.",
        "{file} (edit planes) was made from other palettes.",
        "The pictures are in {folder}.",
    } <= translations.sentences(translations.ROOT).keys()
    assert "{path} marks nothing of {name}." in translations.sentences(translations.ENGINE)


def test_a_file_is_read_as_gettext_does(po):
    path = po(
        'msgid ""\nmsgstr ""\n"Language: xx\\n"\n\n'
        '# of a translator\n#: a.py:1\nmsgid "Close"\nmsgstr "zu"\n\n'
        'msgctxt "Operator"\nmsgid "Close"\nmsgstr "schließen"\n\n'
        'msgid ""\n"Two lines\\n"\n"and \\"quotes\\""\nmsgstr "zwei\\n"\n"\\\\"\n\n'
        '#, fuzzy\nmsgid "Open"\nmsgstr "?"\n\nmsgid "New"\nmsgstr ""\n\n#~ msgid "Old"\n#~ msgstr "alt"\n'
    )
    assert translations.read_po(path) == {
        ("", "Close"): "zu",
        ("Operator", "Close"): "schließen",
        ("", 'Two lines\nand "quotes"'): "zwei\n\\",
        ("", "Open"): "",
        ("", "New"): "",
    }
    assert translations.po_files().read_tables(path.parent) == {
        "xx": {
            ("*", "Close"): "zu",
            ("Operator", "Close"): "schließen",
            ("*", 'Two lines\nand "quotes"'): "zwei\n\\",
            ("Operator", 'Two lines\nand "quotes"'): "zwei\n\\",
        }
    }


@pytest.mark.parametrize(
    ("entry", "reason"),
    {
        "a text without a translation": ('msgid "b"\n', "line 4: not an entry"),
        "no quotes": ("msgid b\nmsgstr c\n", "line 4: not an entry"),
        "an open quote": ('msgid "b\nmsgstr "c"\n', "line 4: not an entry"),
        "other words": ('text "b"\nmsgstr "c"\n', "line 4: not an entry"),
        "an unknown escape": ('msgid "\\q"\nmsgstr "c"\n', "line 4: .*escape"),
        "twice": ('msgid "a"\nmsgstr "c"\n', "line 4: 'a' is translated twice"),
    }.values(),
)
def test_a_malformed_file_is_refused_with_its_line(po, entry, reason):
    with pytest.raises(ValueError, match=f"xx.po, {reason}"):
        translations.read_po(po('msgid "a"\nmsgstr "b"\n\n' + entry))


def test_missing_texts_are_added_once_as_empty_entries(po):
    path = po('msgid "Learn Scene"\nmsgstr "lernen"\n')
    assert translations.add_missing("xx", path) == len(translations.all_texts()) - 1
    assert translations.add_missing("xx", path) == 0
    added = translations.read_po(path)
    assert added.keys() == {("", text) for text in translations.all_texts()}
    assert added["", "Learn Scene"] == "lernen" and set(added.values()) == {"lernen", ""}


def test_a_new_language_starts_with_a_header(tmp_path):
    path = tmp_path / "xx.po"
    translations.add_missing("xx", path)
    assert path.read_text().startswith('msgid ""\nmsgstr ""\n"Language: xx\\n"\n')
    assert not any(translations.read_po(path).values())
