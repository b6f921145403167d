"""USD files that are damaged, hostile or of more than is read give a sentence, whatever usd-core does of them."""

import re
import struct
import sys
from contextlib import suppress

import numpy as np
import pytest

pytest.importorskip("pxr")

from blender_tests.engine.peak import peak_of
from blender_tests.engine.splats.clouds import GROUPS
from blender_tests.engine.splats.formats.files import refused, unit_cloud, written
from karf_engine.errors import DataError
from karf_engine.io import limited
from karf_engine.splats.formats.registry import read_splats

TABLE = unit_cloud(20, 1)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("#usda 1.0", "nothing", "usd-core cannot read it"),
        ("sphericalHarmonicsDegree = 1", "sphericalHarmonicsDegree = 4", "its harmonics are of degree 4"),
        ("def ParticleField3DGaussianSplat", "def Xform", "it has no ParticleField3DGaussianSplat"),
        ("(\n    defaultPrim", "(\n    subLayers = [@/etc/passwd@]\n    defaultPrim", "refers to other files"),
        ("float[] opacities", "float[] other", "has no opacities"),
        ("rotateX = 180", "rotateX = nan", "moved by a matrix"),
    ],
)
def test_broken_usd(old, new, words, tmp_path):
    path = written(tmp_path, ".usda")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    refused(path, words)


@pytest.mark.parametrize("arc", ["references", "payload"])
def test_usd_that_refers_to_other_files(arc, tmp_path):
    path = written(tmp_path, ".usda")
    text = path.read_text()
    more = f'def "More" ({arc} = @/etc/passwd@)\n{{\n}}\n'
    path.write_text(text + more)
    refused(path, "refers to other files, such as /etc/passwd")
    path.write_text(text + f'def "A" (variantSets = "v")\n{{\nvariantSet "v" = {{\n"x" {{\n{more}}}\n}}\n}}\n')
    refused(path, "refers to other files, such as /etc/passwd")
    path.write_text(text + 'def "More" (references = </Gaussians>) {}\n')
    assert len(read_splats(path)) == 2 * len(TABLE)


def test_usd_with_values_in_other_files(tmp_path):
    path = written(tmp_path, ".usda")
    clips = 'clips = { dictionary default = { asset[] assetPaths = [@./other.usda@]\nstring primPath = "/Gaussians" } }'
    old = 'ParticleField3DGaussianSplat "Gaussians"'
    path.write_text(path.read_text().replace(old, f"{old} (\n{clips}\n)"))
    refused(path, "refers to other files, such as the value clips of /Gaussians")


@pytest.mark.parametrize("arc", ["references", "instanceable = true\nreferences"])
def test_usd_references_that_double_are_not_followed(arc, tmp_path, monkeypatch):
    monkeypatch.setattr(limited, "LEAST_BYTES", 1 << 30)
    path = written(tmp_path, ".usda")
    last = 'def Xform "A0" {}\n'
    doubling = (
        f'def Xform "A{n}" {{\ndef "l" ({arc} = </A{n - 1}>) {{}}\ndef "r" ({arc} = </A{n - 1}>) {{}}\n}}\n'
        for n in range(1, 40)
    )
    path.write_text(path.read_text() + last + "".join(doubling))
    refused(path, "crashed or needed too much|more than 10,000 prims", read_splats)


def test_usd_that_refers_to_what_it_has_not(tmp_path):
    path = written(tmp_path, ".usda")
    path.write_text(path.read_text() + 'def "More" (references = </Nothing>) {}\n')
    refused(path, "cannot be composed .*</Nothing>")


def test_a_packed_array_of_usd_that_claims_a_billion_numbers(tmp_path):
    table = unit_cloud(700, 0)
    table[:, GROUPS["opacity"]] = 16  # equal opacities are packed
    path = written(tmp_path, ".usdc", table)
    data, count = path.read_bytes(), struct.pack("<Q", 700)
    places = [match.start() for match in re.finditer(re.escape(count), data)]
    claiming = [data[:place] + struct.pack("<Q", 10**9) + data[place + 8 :] for place in places]
    for changed in claiming:
        path.write_bytes(changed)
        with suppress(DataError):
            read_splats(path)
    path.write_bytes(claiming[0])
    refused(path, "usd-core cannot read it", read_splats)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory has no limit")
@pytest.mark.parametrize(("opening", "closing", "count"), [("(", ")", 40_000), ("[", "]", 400_000), ("(", ")", 10**6)])
def test_text_without_end_takes_no_more_memory_than_its_limit(opening, closing, count, tmp_path):
    path = tmp_path / "cloud.usda"
    path.write_text('#usda 1.0\ndef "a" { float3[] p = [' + count * opening + count * closing + "]}")
    code = "from karf_engine.splats.formats.registry import read_splats; read_splats(Path(sys.argv[1]))"
    peak = peak_of(code, path, fails_with="DataError")
    assert peak < limited.LEAST_BYTES + limited.BYTES_PER_BYTE * path.stat().st_size


def test_z_up_is_turned(tmp_path):
    path = written(tmp_path, ".usda")
    path.write_text(path.read_text().replace('upAxis = "Y"', 'upAxis = "Z"').replace("rotateX = 180", "rotateX = 0"))
    found = read_splats(path).table  # x right, y forward, z up, where PLY has x right, y down, z forward
    np.testing.assert_allclose(found[:, :3], TABLE[:, [0, 2, 1]] * (1, -1, 1), atol=1e-6)
