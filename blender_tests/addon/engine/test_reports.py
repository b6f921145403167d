"""A report has what a developer needs, without names or logins of the user."""

import json
import shutil
import sys

import pytest

HOME, USER, COMPUTER = "/home/anna.schmidt", "anna.schmidt", "lovelace-pc"
TABLE = [
    ("/home/anna.schmidt/film", "~/film"),
    ("open('/home/anna.schmidt'): /home/anna.schmidt\nb", "open('~'): ~\nb"),
    ("Written to /home/anna.schmidt.", "Written to ~."),
    ("/home/anna.schmidt.old /home/anna.schmidt_2", "~.old ~_2"),
    ("/home/anna.schmidtova/x", "/home/anna.schmidtova/x"),
    ("/scratch/anna.schmidt_tmp/a", "/scratch/<user>_tmp/a"),
    ("/tmp/pytest-of-Anna.Schmidt/1", "/tmp/pytest-of-<user>/1"),
    ("/tmp/cache_anna.schmidt2", "/tmp/cache_<user>2"),
    ("D:\\films\\anna.schmidt-old", "D:\\films\\<user>-old"),
    ("/home/joanna.schmidt, anna.schmidtova", "/home/joanna.schmidt, anna.schmidtova"),
    ("annaxschmidt", "annaxschmidt"),
    ("lovelace-pc_01 is away", "<computer>_01 is away"),
    ("https://anna:secret@index.example/simple", "https://<login>@index.example/simple"),
    ("From 'https://t0ken@index.example'.", "From 'https://<login>@index.example'."),
    ("http://a:p@ss:w@rd@h:8080/x?y=1@2", "http://<login>@h:8080/x?y=1@2"),
    ("git+ssh://git:p%40ss@h/r, socks5://u:p@h", "git+ssh://<login>@h/r, socks5://<login>@h"),
    ("https://index.example/@scope/a", "https://index.example/@scope/a"),
    ("https://index.example mail a@b.example", "https://index.example mail a@b.example"),
]


@pytest.fixture(autouse=True)
def names(addon, monkeypatch):
    """The user's names on this computer."""
    monkeypatch.setenv("HOME", HOME)
    monkeypatch.setenv("USERPROFILE", HOME)
    monkeypatch.setattr(addon.failures, "_user", lambda: USER)
    monkeypatch.setattr(addon.failures.platform, "node", lambda: COMPUTER)


@pytest.mark.parametrize("text, anonymous", TABLE)
def test_names_and_logins_are_replaced(addon, text, anonymous):
    assert addon.failures.anonymous(text) == anonymous


def test_windows_home_is_replaced_and_short_names_stay(addon):
    assert addon.failures.without_home("C:\\\\Users\\\\ada\\\\x", "C:\\Users\\ada") == "~\\\\x"
    assert addon.failures.without_home("/usr/bin", "/") == "/usr/bin"
    assert addon.failures.without_name("al", "al", "<user>") == "al"


def test_job_report_has_versions_stage_and_log_without_names(addon, tmp_path):
    (tmp_path / "request.json").write_text(json.dumps({"stage": "geometry"}))
    hello = {"t": "hello", "n": 0, "time": 1, "protocol": 1, "torch": "2.13"}
    (tmp_path / "events.jsonl").write_text(json.dumps(hello) + "\n")
    (tmp_path / "engine.log").write_text("early\n" * 50 + f"open('{HOME}/a.png')\nlast line\n")
    versions = {"KaRF": "0.1", "Blender": "4.5", "Engine Python": f"{HOME}/venv/python"}
    text = addon.failures.compose(tmp_path, "The engine crashed (SIGSEGV).", versions)
    for part in ("KaRF: 0.1", "Blender: 4.5", "System: ", "Stage: geometry", "torch 2.13", "SIGSEGV", "last line"):
        assert part in text
    assert "Engine Python: ~/venv/python" in text and HOME not in text and text.count("early") == 28
    shutil.rmtree(tmp_path)
    assert "Log: \nnone" in addon.failures.compose(tmp_path, "It crashed.", versions)


def test_findings_report_has_no_names(bpy, addon, preferences):
    finding = addon.engine_api.Finding
    found = (
        finding("python", "ok", f"Python 3.11, {HOME}/engine/bin/python, is tested."),
        finding("disk", "error", "8 GB are free on /media/Anna.Schmidt/films.", "Ask the owner of lovelace-pc.", "rm"),
    )
    text = addon.failures.compose_findings(found, {"KaRF": "0.1.0", "Engine Python": f"{HOME}/engine/bin/python"})
    assert "KaRF: 0.1.0" in text and "~/engine/bin/python" in text and "error    8 GB are free" in text
    assert "schmidt" not in text.lower() and "lovelace" not in text
    preferences.engine_python = sys.executable
    assert not bpy.ops.karf.copy_findings.poll()
    with pytest.raises(RuntimeError):
        bpy.ops.karf.examine_engine()
    assert bpy.ops.karf.copy_findings() == {"FINISHED"}
