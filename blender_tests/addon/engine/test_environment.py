"""The engine's Python: which one is chosen, and what is said of one that cannot run it."""

import pytest


def test_the_preference_wins_over_the_variable_that_over_the_installed_engine_and_that_over_the_checkout(
    addon, chosen, tmp_path, monkeypatch
):
    find = addon.preferences.engine_python
    preferred, variable = tmp_path / "preferred", tmp_path / "variable"
    installed = addon.home.python_of(tmp_path / "engine" / "env")
    beside = addon.home.python_of(tmp_path / ".venv" / "engine")
    for path in (preferred, variable, installed, beside):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    monkeypatch.setattr(addon.engine_api, "ENGINE_FOLDER", tmp_path / "karf_engine")
    monkeypatch.setattr(addon.home, "python_in", lambda folder: installed if installed.exists() else None)
    monkeypatch.setenv("KARF_ENGINE_PYTHON", str(variable))
    chosen.engine_python = str(preferred)
    assert find() == preferred
    chosen.engine_python = ""
    assert find() == variable
    monkeypatch.delenv("KARF_ENGINE_PYTHON")
    assert find() == installed
    installed.unlink()
    assert find() == beside
    beside.unlink()
    with pytest.raises(addon.engine_api.MissingDependency, match="no engine yet"):
        find()
    chosen.engine_python = str(tmp_path / "gone")
    with pytest.raises(addon.engine_api.MissingDependency, match="gone"):
        find()


@pytest.mark.filterwarnings("ignore:.*blend relative")
@pytest.mark.parametrize("path", ["//python", "python", "./python", "tools/python"])
def test_a_path_that_depends_on_the_open_file_is_refused(bpy, addon, chosen, tmp_path, monkeypatch, path):
    """A stranger's .blend may have any program beside it."""
    (tmp_path / "python").write_text("")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("KARF_ENGINE_PYTHON", path)
    with pytest.raises(addon.engine_api.MissingDependency, match="absolute path"):
        addon.preferences.engine_python()
    chosen.engine_python = path
    with pytest.raises(addon.engine_api.MissingDependency, match="absolute path"):
        addon.preferences.engine_python()
    with pytest.raises(RuntimeError, match="absolute path"):
        bpy.ops.karf.examine_engine()
