"""A report tells neither who the user is nor how they log in."""

import pytest

HOME, USER, COMPUTER = "/home/anna.schmidt", "anna.schmidt", "lovelace-pc"
TABLE = [
    ("/home/anna.schmidt/film", "~/film"),
    ("Written to /home/anna.schmidt.", "Written to ~."),
    ("/home/anna.schmidt.old /home/anna.schmidt_2", "~.old ~_2"),
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


@pytest.mark.parametrize("text, told", TABLE)
def test_names_and_logins_have_stand_ins(addon, monkeypatch, text, told):
    monkeypatch.setenv("HOME", HOME)
    monkeypatch.setenv("USERPROFILE", HOME)
    monkeypatch.setattr(addon.failures, "_user", lambda: USER)
    monkeypatch.setattr(addon.failures.platform, "node", lambda: COMPUTER)
    assert addon.failures.anonymous(text) == told
