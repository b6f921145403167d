"""The engine's Python: which one is chosen, and what is said of one that cannot run it."""

import pytest


def test_the_preference_wins_over_the_variable_and_that_over_the_checkout(addon, tmp_path, monkeypatch):
    find = addon.environment.find_python
    preferred, variable = tmp_path / "preferred", tmp_path / "variable"
    beside = tmp_path / ".venv" / "engine" / "bin" / "python"
    beside.parent.mkdir(parents=True)
    for path in (preferred, variable, beside):
        path.touch()
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    assert find(str(preferred), {"KARF_ENGINE_PYTHON": str(variable)}) == preferred
    assert find("", {"KARF_ENGINE_PYTHON": str(variable)}) == variable
    assert find("", {}) == beside
    beside.unlink()
    with pytest.raises(addon.engine_api.MissingDependency, match="no engine yet"):
        find("", {})
    with pytest.raises(addon.engine_api.MissingDependency, match="gone"):
        find(str(tmp_path / "gone"), {})


@pytest.mark.filterwarnings("ignore:.*blend relative")
@pytest.mark.parametrize("path", ["//python", "python", "./python", "tools/python"])
def test_a_path_that_depends_on_the_open_file_is_refused(bpy, addon, chosen, tmp_path, monkeypatch, path):
    """A stranger's .blend may have any program beside it."""
    (tmp_path / "python").write_text("")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(addon.engine_api.MissingDependency, match="absolute path"):
        addon.environment.find_python("", {"KARF_ENGINE_PYTHON": path})
    chosen.engine_python = path
    with pytest.raises(addon.engine_api.MissingDependency, match="absolute path"):
        addon.preferences.engine_python()
    with pytest.raises(RuntimeError, match="absolute path"):
        bpy.ops.karf.examine_engine()
