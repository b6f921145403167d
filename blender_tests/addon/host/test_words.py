"""Sentences of errors that come put together are known again, and shown in the user's language."""

import importlib

import pytest


@pytest.fixture
def chinese(addon, monkeypatch):
    """The interface in Chinese, as far as the extension's own words go."""
    tables = importlib.import_module(f"{addon.words.__package__.removesuffix('.host')}.translations").TABLES
    monkeypatch.setattr(addon.words, "pgettext_iface", lambda text: tables["zh_HANS"].get(text, text))


def test_in_english_a_sentence_stays_as_it_is(addon):
    for template in addon.words.sentences.PATTERNS:
        sentence = template.format(*"abcde")
        assert addon.words.translate_sentences(sentence) == sentence
        assert addon.words.translate_sentences(f"{sentence} Try again.") == f"{sentence} Try again."


def test_a_sentence_is_translated_round_its_values(addon, chinese):
    translate = addon.words.translate_sentences
    assert translate("The scene 'Shot 1' has no capture.") == "场景 'Shot 1' 没有拍摄。"
    assert translate("mug.png marks nothing of 'mug'. Paint the object white.") == (
        "mug.png 没有标记 'mug' 的任何部分。 请将物体涂成白色。"
    )
    assert translate("Nobody has translated this.") == "Nobody has translated this."


def test_every_sentence_is_known_by_the_translation_that_is_meant(addon, chinese):
    table = addon.words.sentences.TABLES["zh_HANS"]
    for template, translated in table.items():
        assert addon.words.translate_sentences(template.format(*"abcde")) == translated.format(*"abcde"), template


def test_names_in_sentences_are_not_translated(addon, chinese):
    assert addon.words.translate("Masks") == "遮罩"
    assert "Masks" in addon.words.translate_sentences("The scene has no object Masks.")


def test_an_operator_reports_in_the_language_of_the_interface(bpy, addon, chinese, learned):
    learned.camera = next(each for each in bpy.data.objects if each.type == "CAMERA")
    with pytest.raises(RuntimeError, match="“实时相机”需要窗口"):
        bpy.ops.karf.live_camera()


def test_the_panel_shows_why_a_job_failed_in_the_language_of_the_interface(addon, chinese):
    class Column:
        def __init__(self):
            self.lines = []

        def column(self, align):
            return self

        def label(self, text, icon):
            self.lines.append(text)

    column = Column()
    addon.labels.draw_text(column, "The log in geometry is empty, or gone.\nTry again.", "ERROR", 80)
    assert column.lines == ["geometry 中的日志为空或已不在。", "请重试。"]
