"""A project of a newer version: it is refused in a sentence, and nothing in it is changed."""

import json

import pytest

pytest.importorskip("torch")

from blender_tests.engine.faults.bench import digest
from blender_tests.engine.faults.engine import run
from blender_tests.engine.readers.samples import renew_checksum


def next_version(content):
    content["schema"] = content["schema"].rpartition("/")[0] + "/99"


def unknown_setting(content):
    content["settings"]["geometry"]["invented_later"] = 1


def change_json(path, change):
    content = json.loads(path.read_text())
    content.pop("checksum", None)  # without it what it says is believed
    change(content)
    path.write_text(json.dumps(content))


def change_header(path, change):
    """Change schema and facts of a safetensors file in place."""
    data = path.read_bytes()
    end = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:end])
    content = json.loads(header["__metadata__"]["karf"])
    change(content)
    header["__metadata__"]["karf"] = json.dumps(content)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(len(text).to_bytes(8, "little") + text + data[end:])


def test_every_file_with_a_schema(bench, subtests):
    tensors = [name for name in bench.complete.files if name.endswith(".safetensors")]
    assert tensors
    for name in (*tensors, "project.json", "geometry/capture.json", "recoloring/palette.json"):
        with subtests.test(file=name):
            is_refused(bench, name, change_header if name in tensors else change_json, next_version)


def test_an_unknown_setting(bench):
    is_refused(bench, "project.json", change_json, unknown_setting)


def is_refused(bench, name, write, change):
    scenario = bench.anew("palette")  # reads what no render reads
    bench.restore(scenario.start)
    write(bench.path(name), change)
    renew_checksum(bench.project, bench.path(name))
    before = contents(bench)
    shown, learned = run(bench.render("--planes")), run(scenario.command)
    assert (shown.flaw, learned.flaw) == (None, None)
    assert shown.code or learned.code, "it is taken as if it were of this version"
    if shown.code and learned.code:
        assert {file: digest for file, digest in contents(bench).items() if file in before} == before


def contents(bench):
    return bench.files() | {"project.json": digest(bench.project / "project.json")}
