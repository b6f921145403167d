"""Files that other programs hold open: Windows lets nobody replace them meanwhile, other systems do."""

from pathlib import Path

import pytest

from karf_engine.io import files
from karf_engine.io.files import atomic_write, write_json


@pytest.fixture
def held(monkeypatch):
    """Lets the first renames fail as Windows does; gives how many still will, and the error's number there."""
    state = {"times": 0, "winerror": 32}
    rename = Path.replace

    def replace(path, target):
        if state["times"] > 0:
            state["times"] -= 1
            error = PermissionError(13, "The process cannot access the file", str(target))
            error.winerror = state["winerror"]
            raise error
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    monkeypatch.setattr(files.time, "sleep", lambda seconds: None)
    return state


@pytest.mark.parametrize("winerror", [5, 32, 33, 1224])
def test_a_file_that_another_program_holds_for_a_moment_is_replaced_all_the_same(held, winerror, tmp_path):
    held.update(times=3, winerror=winerror)
    write_json(tmp_path / "state.json", {"stage": 1})
    assert (tmp_path / "state.json").read_bytes() == b'{\n "stage": 1\n}\n'
    assert [path.name for path in tmp_path.iterdir()] == ["state.json"]


def test_one_that_is_held_for_good_stays_as_it_was_and_says_so(held, monkeypatch, tmp_path):
    (tmp_path / "state.json").write_text("earlier")
    held["times"] = 10**9
    monkeypatch.setattr(files, "HELD_SECONDS", 0.0)
    with pytest.raises(PermissionError):
        write_json(tmp_path / "state.json", {})
    assert [path.read_text() for path in tmp_path.iterdir()] == ["earlier"]


def test_a_folder_that_may_not_be_written_is_told_at_once(held, tmp_path):
    held.update(times=1, winerror=None)
    with pytest.raises(PermissionError):
        atomic_write(tmp_path / "note.txt", lambda temporary: temporary.write_text("x"))


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="the system does not list what is mapped")
def test_tensors_that_were_read_do_not_hold_their_file(tmp_path):
    torch = pytest.importorskip("torch")
    from karf_engine.io.checkpoints import load_tensors, save_tensors

    path = tmp_path / "field.safetensors"
    save_tensors(path, {"weights": torch.arange(100_000.0)}, "test/1", {})
    tensors, _ = load_tensors(path, "test/1")
    assert path.name not in Path("/proc/self/maps").read_text()
    assert tensors["weights"][-1] == 99_999
