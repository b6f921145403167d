"""Hypothesis strategies that mutate the bytes of a valid file."""

import copy
import io
import json
import math
import re
import struct
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

from hypothesis import strategies as st

Mutation = Callable[[bytes], st.SearchStrategy[bytes]]
Draw = Callable[[st.SearchStrategy], Any]

INTEGERS = (0, 1, -1, 2, 255, 256, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**63, 2**64 - 1, 10**9)
FLOATS = (math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0.0, 1e30, 1e200)
NUMBERS = [
    (number & (256**size - 1)).to_bytes(size, order)
    for number in INTEGERS
    for size in (1, 2, 4, 8)
    for order in ("little", "big")
] + [struct.pack("<d", number) for number in FLOATS]
WORDS = ("nan", "inf", "-inf", "1e400", "-1", "0", "9" * 23, "18446744073709551615", "9" * 400, "", "#", "..",
         "/etc/passwd", "1.5", "true", "\x00", "é", "-0", "1e-400", "0x10", "1_0", " ")  # fmt: skip
VALUES = (None, True, False, 0, 1, -1, 1e308, -1e308, 1e-320, math.nan, math.inf, 10**30, 10**400, 2**63, "", "x", "..",
          "../../x", "/etc/passwd", "a\0b", "\udcff", "é" * 300, [], {}, [[]], [1, 2, 3], {"a": 1}, [None] * 4, "1.0",
          [[1, 0, 0, 0]] * 4, -0.0, 1e6, 999999, 1e25, "x" * 5000)  # fmt: skip
NAMES = ("../../evil", "/tmp/karf-evil", "..", ".", "", "a/b", "a\\b", "C:\\evil", "a\0b", "é" * 300, "x" * 300, ".hidden",
         "con", "a:b", "a\nb", "\udcff", "../project.json", "~/evil", "$HOME", "-rf", "background", "con.png", " ")  # fmt: skip
NEW_KEYS = ("x", "", "..", "fl_x", "w", "camera_model", "name", "files")
values = st.sampled_from(VALUES).map(copy.deepcopy)
names = st.sampled_from(NAMES)


def happens(draw: Draw, percent: int) -> bool:
    return draw(st.integers(1, 100)) <= percent


@st.composite
def changed_bytes(draw: Draw, data: bytes) -> bytes:
    """Overwrite numbers, flip bits, remove, insert, repeat, or truncate."""
    for _ in range(draw(st.sampled_from((1, 1, 1, 2, 3, 8)))):
        if data:
            data = draw(_byte_change(data, draw(st.integers(0, len(data) - 1))))
    return data


def _byte_change(data: bytes, at: int) -> st.SearchStrategy[bytes]:
    """The data with a few bytes replaced, removed or inserted."""
    flipped = st.integers(0, 7).map(lambda bit: bytes([data[at] ^ 1 << bit]))
    number = st.one_of(flipped, st.binary(min_size=1, max_size=1), st.sampled_from(NUMBERS))
    start, size = st.integers(0, len(data) - 1), st.sampled_from((4, 16, 64))
    repeated = st.builds(lambda start, size: data[start : start + size], start, size)
    return st.one_of(
        st.one_of(number, repeated).map(lambda new: data[:at] + new + data[at + len(new) :]),
        st.sampled_from((1, 2, 4, 16, 100, len(data))).map(lambda size: data[:at] + data[at + size :]),
        st.binary(min_size=1, max_size=16).map(lambda new: data[:at] + new + data[at:]),
    )


@st.composite
def changed_text(draw: Draw, data: bytes) -> bytes:
    """Replace, remove and repeat words; sometimes change bytes."""
    if happens(draw, 25):
        return draw(changed_bytes(data))
    parts = re.split(r"(\s+)", data.decode("utf-8", "surrogateescape"))
    for _ in range(draw(st.sampled_from((1, 1, 2, 4)))):
        at = draw(st.integers(0, max(0, len(parts) - 1)))
        way = draw(st.sampled_from(("replace", "replace", "replace", "remove", "repeat")))
        new = {"replace": [draw(st.sampled_from(WORDS))], "remove": [], "repeat": parts[at : at + 1] * 2}
        parts[at : at + 1] = new[way]
    return "".join(parts).encode("utf-8", "surrogateescape")


@st.composite
def changed_json(draw: Draw, data: bytes) -> bytes:
    """Replace, remove and add values anywhere in a JSON file; sometimes change bytes."""
    if happens(draw, 20):
        return draw(changed_bytes(data))
    return json_bytes(draw(changed_value(json.loads(data))))


def json_bytes(value: Any) -> bytes:
    return json.dumps(value).encode("utf-8", "surrogatepass")


@st.composite
def changed_value(draw: Draw, value: Any) -> Any:
    """The value with parts of it changed, in place where possible."""
    for _ in range(draw(st.sampled_from((1, 1, 1, 2, 3)))):
        places = list(_places(value))
        if not places or happens(draw, 1):
            return draw(values)
        holder, key = draw(st.sampled_from(places))
        way = draw(st.sampled_from(("replace", "replace", "replace", "replace", "remove", "add")))
        if way == "remove":
            del holder[key]
        elif way == "replace":
            holder[key] = draw(values)
        elif isinstance(holder, list):
            holder.insert(key, draw(values))
        else:
            holder[draw(st.sampled_from(NEW_KEYS))] = draw(values)
    return value


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) in a JSON value, and only the beginning of long lists."""
    keys = list(value) if isinstance(value, dict) else range(min(len(value), 30)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key
        yield from _places(value[key])


@st.composite
def changed_zip(draw: Draw, data: bytes) -> bytes:
    """Change, rename or remove one member, usually a JSON one; sometimes change bytes of the archive."""
    if happens(draw, 25):
        return draw(changed_bytes(data))
    with zipfile.ZipFile(io.BytesIO(data)) as stored:
        members = {name: stored.read(name) for name in stored.namelist()}
    described = [name for name in members if name.endswith(".json")]
    name = draw(st.sampled_from([*described * 6, *members]))
    content = members.pop(name)
    way = draw(st.sampled_from(("rename", "remove", *["change"] * 8)))
    if way == "rename":
        members[draw(names) + name[-4:]] = content
    elif way == "change":
        kinds = {"json": changed_json, ".npy": changed_npy}
        members[name] = draw(kinds.get(name[-4:], changed_bytes)(content))
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        for member, content in members.items():
            file.writestr(member.replace("\0", "").encode("utf-8", "replace").decode() or "x", content)
    return packed.getvalue()


@st.composite
def changed_npy(draw: Draw, data: bytes) -> bytes:
    """Change bytes of an npy file, half of the time only in its header."""
    end = len(data) if happens(draw, 50) else 128
    return draw(changed_bytes(data[:end])) + data[end:]


@st.composite
def changed_safetensors(draw: Draw, data: bytes) -> bytes:
    """Change the header, the facts in it, or bytes."""
    if happens(draw, 30):
        return draw(changed_bytes(data))
    if happens(draw, 30):
        return with_header(data, lambda header: draw(changed_value(header)))
    return with_facts(data, lambda facts: draw(changed_value(facts)))


def with_facts(data: bytes, change: Callable[[Any], Any]) -> bytes:
    """A safetensors file with changed facts, which checkpoints.py stores in the header."""

    def in_header(header: dict[str, Any]) -> dict[str, Any]:
        own = json.loads(header["__metadata__"]["karf"])
        header["__metadata__"]["karf"] = json.dumps(own | {"facts": change(own["facts"])})
        return header

    return with_header(data, in_header)


def with_header(data: bytes, change: Callable[[dict[str, Any]], Any]) -> bytes:
    """A safetensors file with a changed header and the same tensors."""
    end = 8 + int.from_bytes(data[:8], "little")
    text = json_bytes(change(json.loads(data[8:end])))
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text + data[end:]
