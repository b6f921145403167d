"""Nearly right files: bytes, words, values, members and names changed by chance.

Each mutator takes the bytes of a valid file and a random.Random (hypothesis brings its own, which it can shrink).
"""

from __future__ import annotations

import copy
import io
import json
import math
import random
import re
import struct
import zipfile
from collections.abc import Callable, Iterator
from typing import Any

Mutator = Callable[[bytes, random.Random], bytes]

INTEGERS = (0, 1, -1, 2, 255, 256, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**63, 2**64 - 1, 10**9)
FLOATS = (math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0.0, 1e30, 1e200)
WORDS = ("nan", "inf", "-inf", "1e400", "-1", "0", "9" * 23, "18446744073709551615", "9" * 400, "", "#", "..",
         "/etc/passwd", "1.5", "true", "\x00", "é", "-0", "1e-400", "0x10", "1_0", " ")  # fmt: skip
VALUES = (None, True, False, 0, 1, -1, 1e308, -1e308, 1e-320, math.nan, math.inf, 10**30, 10**400, 2**63, "", "x", "..",
          "../../x", "/etc/passwd", "a\0b", "\udcff", "é" * 300, [], {}, [[]], [1, 2, 3], {"a": 1}, [None] * 4, "1.0",
          [[1, 0, 0, 0]] * 4, -0.0, 1e6, 999999, 1e25, "x" * 5000)  # fmt: skip
NAMES = ("../../evil", "/tmp/karf-evil", "..", ".", "", "a/b", "a\\b", "C:\\evil", "a\0b", "é" * 300, "x" * 300, ".hidden",
         "con", "a:b", "a\nb", "\udcff", "../project.json", "~/evil", "$HOME", "-rf", "background", "con.png", " ")  # fmt: skip
NAME_KEYS = ("name", "stem", "file_path", "objects", "image", "views", "ply_file_path")


def mutate_bytes(data: bytes, chance: random.Random) -> bytes:
    """Flip bits, overwrite numbers, take out, put in, repeat, cut off."""
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        if not changed:
            break
        at = chance.randrange(len(changed))
        _byte_change(changed, at, chance)
    return bytes(changed)


def _byte_change(data: bytearray, at: int, chance: random.Random) -> None:
    way = chance.randrange(8)
    if way == 0:
        data[at] ^= 1 << chance.randrange(8)
    elif way == 1:
        data[at] = chance.randrange(256)
    elif way == 2:
        size = chance.choice((1, 2, 4, 8))
        number = chance.choice(INTEGERS) & (256**size - 1)
        data[at : at + size] = number.to_bytes(size, chance.choice(("little", "big")))
    elif way == 3:
        del data[at : at + chance.choice((1, 2, 4, 16, 100))]
    elif way == 4:
        data[at:at] = bytes(chance.randrange(256) for _ in range(chance.choice((1, 4, 16))))
    elif way == 5:
        start, size = chance.randrange(len(data)), chance.choice((4, 16, 64))
        data[at : at + size] = data[start : start + size]
    elif way == 6:
        del data[at:]
    else:
        data[at : at + 8] = struct.pack("<d", chance.choice(FLOATS))


def mutate_text(data: bytes, chance: random.Random) -> bytes:
    """Replace, take out and repeat words; sometimes bytes."""
    if chance.random() < 0.25:
        return mutate_bytes(data, chance)
    parts = re.split(r"(\s+)", data.decode("utf-8", "surrogateescape"))
    for _ in range(chance.choice((1, 1, 2, 4))):
        at, way = chance.randrange(len(parts)), chance.randrange(5)
        if way <= 2:
            parts[at] = chance.choice(WORDS)
        elif way == 3 and len(parts) > 1:
            del parts[at]
        else:
            parts.insert(at, chance.choice(parts))
    return "".join(parts).encode("utf-8", "surrogateescape")


def mutate_json(data: bytes, chance: random.Random) -> bytes:
    """Replace, take out and add values anywhere in a JSON file; sometimes bytes."""
    if chance.random() < 0.2:
        return mutate_bytes(data, chance)
    return _json_bytes(mutate_value(json.loads(data), chance))


def _json_bytes(value: Any) -> bytes:
    return json.dumps(value).encode("utf-8", "surrogatepass")


def mutate_value(value: Any, chance: random.Random) -> Any:
    """The value with some of what is in it changed, in place where that is possible."""
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        places = list(_places(value))
        if not places or chance.random() < 0.01:
            return _value(chance)
        holder, key = chance.choice(places)
        way = chance.randrange(6)
        if way <= 3:
            holder[key] = _value(chance)
        elif way == 4:
            del holder[key]
        elif isinstance(holder, list):
            holder.insert(key, _value(chance))
        else:
            holder[chance.choice(("x", "", "..", "fl_x", "w", "camera_model", "name", "files"))] = _value(chance)
    return value


def _value(chance: random.Random) -> Any:
    """One of VALUES, as an object of its own."""
    return copy.deepcopy(chance.choice(VALUES))


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) in a JSON value; of long lists the beginning."""
    keys = list(value) if isinstance(value, dict) else range(min(len(value), 30)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key
        yield from _places(value[key])


def mutate_names(data: bytes, chance: random.Random) -> bytes:
    """Put one hostile name where a JSON file names something that may become a path."""
    value = json.loads(data)
    places = list(_named(value))
    holder, key = chance.choice(places)
    holder[key] = chance.choice(NAMES)
    return _json_bytes(value)


def _named(value: Any, own: bool = False) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) of a text below one of NAME_KEYS."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in list(items):
        below = own or key in NAME_KEYS
        if below and isinstance(inner, str):
            yield value, key
        yield from _named(inner, below)


def mutate_keys(data: bytes, chance: random.Random) -> bytes:
    """Give one object of an edit a hostile name."""
    value = json.loads(data)
    objects = value["objects"]
    objects[chance.choice(NAMES)] = objects.pop(chance.choice(list(objects)))
    return _json_bytes(value)


# ------------------------------------------------------------------------------------------------------ files with parts
def mutate_npz(data: bytes, chance: random.Random) -> bytes:
    """Change one array of an npz and pack it again, checksum and all; sometimes bytes of the whole."""
    if chance.random() < 0.3:
        return mutate_bytes(data, chance)
    with zipfile.ZipFile(io.BytesIO(data)) as stored:
        members = {name: stored.read(name) for name in stored.namelist()}
    name = chance.choice(sorted(members))
    way = chance.randrange(10)
    if way == 0:
        members[chance.choice(NAMES) + ".npy"] = members.pop(name)
    elif way == 1:
        del members[name]
    else:
        members[name] = mutate_head(members[name], 128, chance)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        for member, content in members.items():
            file.writestr(member.replace("\0", "").encode("utf-8", "replace").decode() or "x", content)
    return packed.getvalue()


def mutate_head(data: bytes, size: int, chance: random.Random) -> bytes:
    """Change bytes, half of the time in the first `size`."""
    if chance.random() < 0.5:
        return mutate_bytes(data, chance)
    return mutate_bytes(data[:size], chance) + data[size:]


def mutate_npy(data: bytes, chance: random.Random) -> bytes:
    """Change an npy, half of the time its header."""
    return mutate_head(data, 128, chance)


def mutate_safetensors(data: bytes, chance: random.Random) -> bytes:
    """Change the header's values, the facts in it, or bytes."""
    if chance.random() < 0.3:
        return mutate_bytes(data, chance)
    return with_header(data, lambda header: _header_change(header, chance))


def _header_change(header: dict[str, Any], chance: random.Random) -> dict[str, Any]:
    if chance.random() < 0.3:
        return mutate_value(header, chance)
    return with_facts(header, lambda facts: mutate_value(facts, chance))


def name_safetensors(data: bytes, chance: random.Random) -> bytes:
    """Give one object in the facts a hostile name."""

    def change(facts: dict[str, Any]) -> dict[str, Any]:
        facts["objects"][chance.randrange(len(facts["objects"]))] = chance.choice(NAMES)
        return facts

    return with_header(data, lambda header: with_facts(header, change))


def with_facts(header: dict[str, Any], change: Callable[[Any], Any]) -> dict[str, Any]:
    """A safetensors header with other facts, where checkpoints.py writes them."""
    own = json.loads(header["__metadata__"]["karf"])
    header["__metadata__"]["karf"] = json.dumps(own | {"facts": change(own["facts"])})
    return header


def with_header(data: bytes, change: Callable[[dict[str, Any]], Any]) -> bytes:
    """A safetensors file with another header and the same tensors."""
    end = 8 + int.from_bytes(data[:8], "little")
    text = _json_bytes(change(json.loads(data[8:end])))
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text + data[end:]
