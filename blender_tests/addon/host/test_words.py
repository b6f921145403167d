"""Messages are translated into the user's language where they are shown."""

import importlib
from pathlib import Path

import pytest

from ..layout import Layout


@pytest.fixture
def chinese(addon, monkeypatch):
    """The extension's interface in Chinese."""
    package = importlib.import_module(f"{addon.words.__package__.removesuffix('.host')}.translations")
    table = package.po_files.read_tables(Path(package.__file__).parent)["zh_HANS"]
    monkeypatch.setattr(addon.words, "pgettext_iface", lambda text: table.get(("*", text), text))


def test_message_is_translated_around_its_values(addon, chinese):
    api, translate, template = addon.engine_api, addon.words.translate_message, "{path} marks nothing of {name!r}."
    message = api.Message(template, path="mug.png", name="mug")
    assert message == "mug.png marks nothing of 'mug'."
    assert translate(message) == "mug.png 没有标记 'mug' 的任何部分。"
    assert translate("Import a capture first.") == "请先导入拍摄。"
    assert translate("Nobody has translated this.") == "Nobody has translated this."
    assert addon.words.translate("Masks") == "遮罩"  # but not as an object's name:
    assert "Masks" in translate(api.Message("The scene has no object {name!r}.", name="Masks"))
    error = api.DataError(template, "Paint the object white.", path="mug.png", name="mug")
    assert addon.words.translate_error(error) == f"{translate(message)} 请将物体涂成白色。"


def test_nested_messages_and_property_texts_are_translated(addon, chinese):
    make, translate = addon.engine_api.Message, addon.words.translate_message
    inner = make("The pictures are in {folder}.", folder="/film")
    outer = make("The scene that requested this is gone or has another project. {result}", result=inner)
    assert translate(outer).endswith(translate(inner)) and "/film" in translate(inner) != inner
    addon.progress.warn(inner)
    (text,) = addon.progress.state().warnings.splitlines()
    assert text == "The pictures are in /film." and translate(text) == translate(inner)
    addon.progress.dismiss()


def test_english_messages_stay_unchanged(addon):
    made = addon.engine_api.Message("The pictures are in {folder}.", folder="/film {1}")
    for message in ("Import a capture first.", made):
        assert addon.words.translate_message(message) == message


def test_operator_reports_in_the_interface_language(bpy, chinese, learned):
    learned.camera = next(each for each in bpy.data.objects if each.type == "CAMERA")
    with pytest.raises(RuntimeError, match="“实时相机”需要窗口"):
        bpy.ops.karf.live_camera()


def test_panel_shows_errors_in_the_interface_language(bpy, addon, chinese):
    drawn, message = [], addon.engine_api.Message("The log in {job} is empty or missing.", job="geometry")
    for text in (message, "Try again."):
        addon.words.draw_text(Layout(bpy, drawn), text, "ERROR", 80)
    assert drawn == ["geometry 中的日志为空或已不在。", "请重试。"]
