"""Settings: presets, overrides, and errors that suggest the nearest name."""

import dataclasses
import json

import pytest

from karf_engine.errors import BadRequest
from karf_engine.project.settings import PRESETS, Level, Settings, describe, from_dict, preset, to_dict, with_overrides


@pytest.mark.parametrize("name", PRESETS)
def test_presets_survive_json_and_are_in_range(name):
    settings = preset(name)
    assert settings.preset == name
    assert from_dict(json.loads(json.dumps(to_dict(settings)))) == settings


def test_paper_preset_has_the_numbers_of_the_paper():
    paper = preset("paper")
    nerf = paper.geometry.nerf
    assert paper.geometry.field == "nerf"
    assert (nerf.depth, nerf.width, nerf.position_frequencies, nerf.direction_frequencies) == (8, 256, 10, 4)
    assert (nerf.coarse_samples, nerf.fine_samples) == (64, 128)
    assert (nerf.iterations, nerf.rays, nerf.rate) == (120_000, 2048, 5e-5)
    first, second = paper.segmentation, paper.recoloring
    assert (first.iterations, first.batch, first.rate, first.labels) == (2000, 1024, 5e-4, "masks")
    assert (second.iterations, second.batch, second.rate, second.palette_rate) == (5000, 1024, 5e-4, 5e-4)
    assert (second.palette_loss, second.weight_loss) == (1.0, 0.1)
    assert second.iterations * second.palette_share == 2000
    assert (first.width, second.width, first.head, first.layer, first.variant) == (256, 256, "kan", "grbf", "all")
    assert first.schedule == second.schedule == "constant"
    assert first.samples_per_ray == (nerf.coarse_samples + nerf.fine_samples) // 3  # what memory holds
    assert (first.frequencies, second.frequencies, second.direction_frequencies) == (10, 10, 4)
    assert paper.palette.shared and paper.compositing == "paper"
    assert [name for name in PRESETS if PRESETS[name].splats.iterations == 0] == ["paper"]


def test_unknown_preset_is_rejected_with_the_known_ones():
    with pytest.raises(BadRequest, match=f"Unknown preset 'best'.*{'.*'.join(PRESETS)}"):
        preset("best")


def test_overrides_change_only_their_fields():
    changed = with_overrides(Settings(), ["geometry.long_side=64", "palette.shared=true", "seed = 7"])
    assert (changed.geometry.long_side, changed.palette.shared, changed.seed) == (64, True, 7)
    geometry = dataclasses.replace(changed.geometry, long_side=Settings().geometry.long_side)
    palette = dataclasses.replace(changed.palette, shared=False)
    assert dataclasses.replace(changed, seed=0, geometry=geometry, palette=palette) == Settings()


@pytest.mark.parametrize(
    ("overrides", "group", "name", "value"),
    [
        (["segmentation.head=kan", "segmentation.head=mlp"], "segmentation", "head", "mlp"),
        (["palette.tolerance=0"], "palette", "tolerance", 0.0),
        (['geometry.levels=[{"voxels": 20, "iterations": 5, "step": 1}]'], "geometry", "levels", (Level(20, 5, 1.0),)),
    ],
    ids=["later word wins", "integer as float", "levels as list"],
)
def test_override_values_take_the_type_of_their_field(overrides, group, name, value):
    found = getattr(getattr(with_overrides(Settings(), overrides), group), name)
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize(
    ("override", "words", "hint"),
    [
        ("geometry.max_ray=5", "Unknown setting geometry.max_ray.", "geometry.max_rays"),
        ("geometri.max_rays=5", "Unknown setting 'geometri.max_rays'", "geometry"),
        ("sead=1", "Unknown setting sead.", "seed"),
        ("palette.colours=3", "Unknown setting palette.colours.", "palette.colors"),
        ("seed.x=1", "Unknown setting 'seed.x'", "geometry"),
        ("palette.qqqqq=1", "Unknown setting palette.qqqqq.", "tolerance"),
        ("geometry.long_side=5", "geometry.long_side = 5 is out of range", ""),
        ("geometry.table_rate=NaN", "is out of range", ""),
        ("seed=-1", "seed = -1 is out of range", ""),
        (f"seed={'9' * 5000}", "seed", ""),
        ("geometry.long_side=big", "geometry.long_side = 'big' is not of type int", ""),
        ("geometry.long_side=64.5", "is not of type int", ""),
        ("geometry.long_side=true", "is not of type int", ""),
        ("palette.shared=1", "palette.shared = 1 is not of type bool", ""),
        ("segmentation.head=forest", "segmentation.head = 'forest' is not allowed", ""),
        ("geometry=5", "geometry = 5 is not a group of settings", ""),
        ("geometry.long_side", "has no '='", ""),
    ],
)
def test_invalid_overrides_are_rejected_with_a_hint(override, words, hint):
    with pytest.raises(BadRequest) as caught:
        with_overrides(Settings(), [override])
    assert words in caught.value.sentence and caught.value.hint and hint in caught.value.hint


def level(voxels=64, iterations=5, step=1):
    return f'[{{"voxels": {voxels}, "iterations": {iterations}, "step": {step}}}]'


LEVELS = [
    *("7", "[]", "[" * 100_000, "9" * 5000, '[{"voxels": 64}]'),
    *(level(voxels=value) for value in ("2", "3", "Infinity", "NaN", "1e9", "100000")),
    *(level(iterations="0"), level(iterations="1e12"), level(step="0"), level(step="1.5"), level(step="NaN")),
]


@pytest.mark.parametrize("value", LEVELS)
def test_invalid_levels_are_rejected(value):
    with pytest.raises(
        BadRequest, match=r"geometry\.levels (= .* is not a list of|holds an empty or impossible) level"
    ):
        with_overrides(Settings(), [f"geometry.levels={value}"])


def leaves(content, where=""):
    """Dotted names of all settings in nested groups."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{where}{name}.")
        else:
            yield where + name


def test_every_setting_is_described_with_default_and_range():
    rows = {name: (default, text) for name, default, text in describe()}
    assert rows["seed"] == (0, f"Seed of every random number [0 .. {2**31 - 1}]")
    assert "kan | mlp" in rows["segmentation.head"][1]
    assert set(rows) == set(leaves(dataclasses.asdict(Settings()))) - {"preset"}
    assert all(text.strip() for _, text in rows.values())
