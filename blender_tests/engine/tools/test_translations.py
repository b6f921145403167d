"""All that the extension shows is translated, and translated as it is filled in."""

import string

import pytest

from tools import translations


def test_sentences_with_values_can_be_translated():
    assert translations.untranslatable() == []


@pytest.mark.parametrize("language", translations.languages())
def test_a_language_has_every_text(language):
    assert translations.missing(language) == []


@pytest.mark.parametrize("language", translations.languages())
def test_a_language_has_no_sentence_that_nobody_says(language):
    assert translations.stale(language) == []


@pytest.mark.parametrize("language", translations.languages())
def test_a_translation_has_the_places_of_the_values(language):
    def places(text):
        return sorted(name for _, name, _, _ in string.Formatter().parse(text) if name)

    for text, translated in translations.table(language).items():
        assert translated.strip() and places(text) == places(translated), text


def test_what_is_shown_is_found():
    found = translations.texts()
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
    } <= translations.sentences(translations.ROOT)
    assert "{path} marks nothing of {name}." in translations.sentences(translations.ENGINE)
