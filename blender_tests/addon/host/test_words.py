"""Messages are put into the user's language where they are shown."""

import importlib
from pathlib import Path

import pytest


@pytest.fixture
def chinese(addon, monkeypatch):
    """The interface in Chinese, as far as the extension's own words go."""
    package = importlib.import_module(f"{addon.words.__package__.removesuffix('.host')}.translations")
    table = package.po_files.read_tables(Path(package.__file__).parent)["zh_HANS"]
    monkeypatch.setattr(addon.words, "pgettext_iface", lambda text: table.get(("*", text), text))


@pytest.fixture
def make(addon):
    return addon.engine_api.Message


def test_a_message_is_translated_round_its_values(addon, chinese, make):
    translate = addon.words.translate_message
    message = make("{path} marks nothing of {name!r}.", path="mug.png", name="mug")
    assert message == "mug.png marks nothing of 'mug'."
    assert translate(message) == "mug.png 没有标记 'mug' 的任何部分。"
    assert translate("Import a capture first.") == "请先导入拍摄。"
    assert translate("Nobody has translated this.") == "Nobody has translated this."


def test_a_message_in_a_message_is_translated_too(addon, chinese, make):
    inner = make("The pictures are in {folder}.", folder="/film")
    outer = make("The scene that requested this is gone or has another project. {result}", result=inner)
    assert addon.words.translate_message(outer).endswith(addon.words.translate_message(inner))
    assert addon.words.translate_message(inner) != inner


def test_an_error_is_translated_with_its_remedy(addon, chinese):
    error = addon.engine_api.DataError(
        "{path} marks nothing of {name!r}.", "Paint the object white.", path="mug.png", name="mug"
    )
    assert addon.words.translate_error(error) == "mug.png 没有标记 'mug' 的任何部分。 请将物体涂成白色。"


def test_what_a_property_holds_as_english_text_is_translated_where_it_is_shown(addon, chinese, make):
    addon.progress.warn(make("The pictures are in {folder}.", folder="/film"))
    (text,) = addon.progress.state().warnings.splitlines()
    assert text == "The pictures are in /film."
    assert "/film" in addon.words.translate_message(text) != text
    addon.progress.dismiss()


def test_in_english_a_message_stays_as_it_is(addon, make):
    for message in ("Import a capture first.", make("The pictures are in {folder}.", folder="/film {1}")):
        assert addon.words.translate_message(message) == message


def test_names_in_sentences_are_not_translated(addon, chinese, make):
    assert addon.words.translate("Masks") == "遮罩"
    assert "Masks" in addon.words.translate_message(make("The scene has no object {name!r}.", name="Masks"))


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
    reason = addon.engine_api.Message("The log in {job} is empty or missing.", job="geometry")
    addon.words.draw_text(column, reason, "ERROR", 80)
    addon.words.draw_text(column, "Try again.", "ERROR", 80)
    assert column.lines == ["geometry 中的日志为空或已不在。", "请重试。"]
