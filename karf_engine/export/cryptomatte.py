"""Object mattes by the Cryptomatte specification 1.2.0 (Friedman and Jones, Psyop 2016).

Each pixel stores pairs of object id and coverage ("ranks"), by falling coverage, two pairs per RGBA layer. An id is the
hash of the object's name, as the bits of a float.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

NAME = "CryptoObject"
CHANNELS = "RGBA"
BAND_ROWS = 128


def murmur3(data: bytes) -> int:
    """Return MurmurHash3_x86_32 with seed 0 (Appleby 2011)."""
    state, mask = 0, 0xFFFFFFFF
    for start in range(0, len(data), 4):
        block = data[start : start + 4]
        mixed = int.from_bytes(block, "little") * 0xCC9E2D51 & mask
        mixed = (mixed << 15 | mixed >> 17) * 0x1B873593 & mask
        state ^= mixed
        if len(block) == 4:
            state = ((state << 13 | state >> 19) & mask) * 5 + 0xE6546B64 & mask
    state ^= len(data)
    state = (state ^ state >> 16) * 0x85EBCA6B & mask
    state = (state ^ state >> 13) * 0xC2B2AE35 & mask
    return state ^ state >> 16


def object_id(name: str) -> int:
    """Return an object's id: the hash of its name, with one bit flipped if it is not a normal float."""
    bits = murmur3(name.encode("utf-8"))
    exponent = bits >> 23 & 255
    return bits ^ 1 << 23 if exponent in (0, 255) else bits


def header(objects: Sequence[str], name: str = NAME) -> dict[str, str]:
    """Return the file's metadata. name: prefix of the layers' names."""
    key = f"cryptomatte/{murmur3(name.encode()):08x}"[:19]  # seven letters of the hash
    manifest = {each: f"{object_id(each):08x}" for each in objects}
    return {
        f"{key}/name": name,
        f"{key}/hash": "MurmurHash3_32",
        f"{key}/conversion": "uint32_to_float32",
        f"{key}/manifest": json.dumps(manifest, ensure_ascii=False, separators=(",", ":")),
    }


def channels(objects: Sequence[str], coverage: np.ndarray) -> dict[str, np.ndarray]:
    """Return the channels of the layers CryptoObject00, CryptoObject01 and so on, float32 [H, W] by name.

    coverage: [K, H, W] in [0, 1], any float, of these K objects.
    """
    _, height, width = coverage.shape
    bands = [slice(top, top + BAND_ROWS) for top in range(0, height, BAND_ROWS)]
    most = max((int((coverage[:, rows] > 0).sum(0).max(initial=0)) for rows in bands), default=0)
    n_layers = max(1, -(-most // 2))
    names = [f"{NAME}{layer:02}.{letter}" for layer in range(n_layers) for letter in CHANNELS]
    planes = {name: np.zeros((height, width), np.float32) for name in names}
    ids = np.array([object_id(name) for name in objects], np.uint32).view(np.float32)
    for rows in bands:
        order = np.argsort(-coverage[:, rows], axis=0, kind="stable")[: 2 * n_layers]
        shares = np.take_along_axis(coverage[:, rows], order, axis=0)
        for rank, (share, which) in enumerate(zip(shares, order, strict=True)):
            planes[names[2 * rank]][rows] = np.where(share > 0, ids[which], 0)
            planes[names[2 * rank + 1]][rows] = share
    return planes
