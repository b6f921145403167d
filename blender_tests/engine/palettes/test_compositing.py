"""Compositing of edit planes: the formula, and the promises that unchanged means unchanged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from karf_engine.errors import DataError
from karf_engine.palettes.compositing import (
    Planes,
    delta_composite,
    paper_composite,
    read_planes,
    stack_palettes,
    write_planes,
)


@pytest.fixture
def scene() -> dict[str, np.ndarray]:
    """Two objects of 4 palette entries in a 300 x 170 picture; the lower third is background."""
    random = np.random.default_rng(3)
    size = (300, 170)
    weights = random.dirichlet(np.ones(9), size)[..., :8].transpose(2, 0, 1).reshape(2, 4, *size)
    weights[:, :, 200:] = 0
    palettes = random.random((2, 4, 3)).astype(np.float32)
    palettes[:, 0] = 0
    return {
        "base": random.integers(0, 256, (*size, 3)).astype(np.float32) / np.float32(255),
        "palette_weights": weights.astype(np.float32),
        "learned": palettes,
    }


def test_unchanged_palette_gives_identical_bytes(scene: dict[str, np.ndarray]) -> None:
    result = delta_composite(**scene, edited=scene["learned"].copy())
    assert result.tobytes() == scene["base"].tobytes()
    assert result is not scene["base"]


def test_delta_is_base_plus_weights_times_change(scene: dict[str, np.ndarray]) -> None:
    edited = scene["learned"].copy()
    edited[0, 2] = [1, 0.2, 0]
    edited[1, 3] = [0, 0.9, 0.3]
    change = (edited - scene["learned"]).astype(float)
    expected = np.clip(scene["base"] + np.einsum("kjhw,kjc->hwc", scene["palette_weights"].astype(float), change), 0, 1)
    result = delta_composite(**scene, edited=edited)
    assert result.dtype == np.float32
    np.testing.assert_allclose(result, expected, atol=3e-7)
    # no object reaches the lower third
    np.testing.assert_array_equal(result[200:], scene["base"][200:])


def test_pixels_without_the_changed_swatch_keep_their_bits(scene: dict[str, np.ndarray]) -> None:
    scene["palette_weights"][1, 1, :, ::2] = 0
    edited = scene["learned"].copy()
    edited[1, 1] = 1 - edited[1, 1]
    result = delta_composite(**scene, edited=edited)
    np.testing.assert_array_equal(result[:, ::2], scene["base"][:, ::2])
    assert (result[:200, 1::2] != scene["base"][:200, 1::2]).mean() > 0.9


def test_result_can_be_written_into_the_colors_of_an_rgba_buffer(scene: dict[str, np.ndarray]) -> None:
    edited = 1 - scene["learned"]
    rgba = np.full((*scene["base"].shape[:2], 4), 7, np.float32)
    delta_composite(**scene, edited=edited, out=rgba[..., :3])
    np.testing.assert_array_equal(rgba[..., :3], delta_composite(**scene, edited=edited))
    assert (rgba[..., 3] == 7).all()


def test_half_precision_planes_differ_by_less_than_a_byte_step(scene: dict[str, np.ndarray]) -> None:
    edited = 1 - scene["learned"]
    exact = delta_composite(**scene, edited=edited)
    scene["palette_weights"] = scene["palette_weights"].astype(np.float16)
    half = delta_composite(**scene, edited=edited)
    assert 0 < np.abs(exact - half).max() < 0.5 / 255


def test_paper_composite_repaints_the_hard_mask_and_nothing_else() -> None:
    base = np.full((1, 4, 3), 0.5, np.float32)
    # pixels: background, object 0, object 1, object 0 against a stronger background
    probabilities = np.array([[[0, 0.8, 0.3, 0.4]], [[0, 0.1, 0.6, 0.0]]], np.float32)
    shares = np.array([[0.25, 0.75], [0.5, 0.5]], np.float32)
    weights = shares[:, :, None, None] * probabilities[:, None]
    edited = np.array([[[0, 0, 0], [0.8, 0.4, 0]], [[0, 0, 0], [0, 0, 1]]], np.float32)
    result = paper_composite(base, weights, probabilities, edited)
    np.testing.assert_allclose(result[0], [[0.5] * 3, [0.6, 0.3, 0], [0, 0, 0.5], [0.5] * 3], atol=1e-6)


def test_smaller_palettes_are_padded_with_zeros() -> None:
    colors = {"a": np.ones((2, 3)), "b": np.full((3, 3), 0.5)}
    stacked = stack_palettes(("b", "a"), colors)
    np.testing.assert_array_equal(stacked[0], colors["b"])
    np.testing.assert_array_equal(stacked[1], [[1, 1, 1], [1, 1, 1], [0, 0, 0]])
    assert stack_palettes((), colors).shape == (0, 0, 3)


@pytest.mark.parametrize("compositing", ["delta", "paper"])
def test_one_shared_palette_becomes_many_colors_and_many_palettes_one(compositing: str) -> None:
    """The left half is object a, the right half b; both of the swatch they share, or each of its own."""
    weights = np.zeros((2, 2, 4, 8), np.float32)
    weights[0, 1, :, :4], weights[1, 1, :, 4:] = 1, 1
    shared, own = [[0, 0, 0], [0.8, 0.2, 0.2]], [[0, 0, 0], [0.1, 0.3, 0.9]]
    blue, green = np.float32([0.2, 0.3, 0.9]), np.float32([0.1, 0.7, 0.2])

    def recolored(learned: dict, edited: dict) -> np.ndarray:
        learned, edited = (
            stack_palettes(["a", "b"], {k: np.float32(v) for k, v in d.items()}) for d in (learned, edited)
        )
        base = np.einsum("kmhw,kmc->hwc", weights, learned)
        if compositing == "paper":
            return paper_composite(base, weights, weights.sum(1), edited)
        return delta_composite(base, weights, learned, edited)

    many = recolored({"a": shared, "b": shared}, {"a": [[0, 0, 0], blue], "b": [[0, 0, 0], green]})
    np.testing.assert_allclose(many[:, :4], np.broadcast_to(blue, (4, 4, 3)), atol=1e-6)
    np.testing.assert_allclose(many[:, 4:], np.broadcast_to(green, (4, 4, 3)), atol=1e-6)
    one = recolored({"a": shared, "b": own}, {"a": [[0, 0, 0], blue], "b": [[0, 0, 0], blue]})
    np.testing.assert_allclose(one, np.broadcast_to(blue, (4, 8, 3)), atol=1e-6)


def test_no_objects_leave_the_base(scene: dict[str, np.ndarray]) -> None:
    none = np.zeros((0, 0, 3), np.float32)
    result = delta_composite(scene["base"], np.zeros((0, 0, 300, 170), np.float32), none, none)
    np.testing.assert_array_equal(result, scene["base"])


def make_planes() -> Planes:
    random = np.random.default_rng(4)
    weights = random.random((2, 3, 5, 6)).astype(np.float16)
    base = random.integers(0, 256, (5, 6, 3)).astype(np.uint8)
    return Planes(("pot", "tea cup é"), weights, weights.sum(axis=1), base)


def test_planes_come_back_bit_by_bit(tmp_path: Path) -> None:
    planes, path = make_planes(), tmp_path / "planes" / "view.npz"
    write_planes(path, planes)
    read = read_planes(path)
    assert read.objects == planes.objects
    for name in ("palette_weights", "probabilities", "base"):
        assert getattr(read, name).dtype == getattr(planes, name).dtype
        np.testing.assert_array_equal(getattr(read, name), getattr(planes, name))
    assert list(path.parent.iterdir()) == [path]


def test_planes_keep_how_their_photo_is_exposed(tmp_path: Path) -> None:
    planes, path = make_planes(), tmp_path / "view.npz"
    write_planes(path, planes)
    assert "gains" not in np.load(path)
    write_planes(path, replace(planes, gains=(0.75, 1.0, 1.25)))
    assert read_planes(path).gains == (0.75, 1.0, 1.25)
    for wrong in (0.0, np.nan):
        write_planes(path, replace(planes, gains=(0.75, 1.0, wrong)))
        with pytest.raises(DataError, match="gains"):
            read_planes(path)


def test_damaged_planes_are_refused_by_name(tmp_path: Path) -> None:
    planes, path = make_planes(), tmp_path / "view.npz"
    with pytest.raises(DataError, match=r"view\.npz.*does not exist"):
        read_planes(path)
    write_planes(path, planes)
    content = path.read_bytes()
    scrambled = content[:200] + bytes(100) + content[300:]
    for broken in (b"not a zip", content[: len(content) // 2], b"", scrambled):
        path.write_bytes(broken)
        with pytest.raises(DataError, match=r"view\.npz"):
            read_planes(path)
    write_planes(path, Planes(planes.objects, planes.palette_weights[..., :-1], planes.probabilities, planes.base))
    with pytest.raises(DataError, match="weights"):
        read_planes(path)
