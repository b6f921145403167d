"""Tables of real captures: what lacks is named with its source, and the rows are those of the page."""

import pytest

pytest.importorskip("skimage")
pytest.importorskip("torch")

import numpy as np

from blender_tests.engine.tools.test_docs import DOCS
from karf_engine.io.images import write_png
from tools.scenes import real_captures
from tools.scenes.real_captures import CAPTURES, corrected_rows, mask_rows, picture_rows

SUMMARY = {
    "psnr_full": 27.26,
    "psnr_full_worst": 26.21,
    "cc_psnr_full": 27.81,
    "cc_psnr_full_worst": 26.64,
    "splats": {
        "psnr": 29.6,
        "psnr_worst": 28.3,
        "psnr_exposed": 29.7,
        "psnr_exposed_worst": 28.31,
        "cc_psnr": 30.12,
        "cc_psnr_worst": 28.9,
    },
    "stage_seconds": {"geometry": 104.2, "splats": 125.1},
    "peak_memory": 1.5 * 2**30,
}


def fill(folder, known):
    """Empty files in a capture's layout."""
    count, pattern = known.photos
    for path in (*known.files, *(pattern.replace("*", f"photo_{n}") for n in range(count))):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).touch()


@pytest.mark.parametrize("name", CAPTURES)
def test_a_folder_in_its_layout_lacks_nothing_but_the_masks_of_its_source(name, tmp_path):
    fill(tmp_path, CAPTURES[name])
    assert len(CAPTURES[name].lacks(tmp_path)) == (CAPTURES[name].masks is not None)


def test_what_lacks_is_named_before_anything_is_learned_with_its_source(tmp_path):
    fill(tmp_path / "fruit", CAPTURES["fruit"])
    (tmp_path / "fruit" / "transforms.json").unlink()
    (tmp_path / "fruit" / "newfruit_small" / "photo_3.jpg").unlink()
    with pytest.raises(SystemExit) as refused:
        real_captures.check(tmp_path, ["fruit", "goldcape"])
    for words in ("transforms.json is missing", "80 photos in the place of 81", "tusharparimi/fruit-NeRF"):
        assert words in str(refused.value)
    assert "vork/moldGoldCape" in str(refused.value) and "CC BY-NC-SA 4.0" in str(refused.value)


def test_masks_by_color_are_written_beside_what_is_learned(tmp_path, monkeypatch):
    photo = np.full((40, 40, 3), (0.15, 0.35, 0.15))
    photo[10:30, 10:30] = (0.9, 0.35, 0.25)
    write_png(tmp_path / "photo.png", photo)
    view = type("View", (), {"image": tmp_path / "photo.png", "stem": "photo"})
    monkeypatch.setattr(real_captures.karf, "open_capture", lambda folder: type("Capture", (), {"views": [view]}))
    folder = real_captures.true_masks(CAPTURES["flower"], tmp_path, tmp_path / "masks")
    assert [str(path.relative_to(folder)) for path in folder.rglob("*.png")] == ["blossom/photo.png"]
    assert real_captures.true_masks(CAPTURES["bonsai"], tmp_path, tmp_path / "none") is None
    assert real_captures.true_masks(CAPTURES["goldcape"], tmp_path, tmp_path / "own") == tmp_path / "masks_gt"


def test_rows_show_figures_of_what_was_judged():
    (_, _, row) = picture_rows({"flower": SUMMARY})
    assert row == "| flower | 27.3, 26.2 dB | 29.6, 28.3 dB | 29.7, 28.3 dB | 104 | 125 |  | 1.5 GiB |"
    (_, _, row) = corrected_rows({"flower": SUMMARY})
    assert row == "| flower | 27.3, 26.2 dB | 27.8, 26.6 dB | 29.6, 28.3 dB | 30.1, 28.9 dB |"
    of_before = {key: value for key, value in SUMMARY.items() if not key.startswith("cc_")}
    assert len(corrected_rows({"flower": of_before})) == 2
    keys = ("iou", "iou_worst_view", "iou_border_excluded", "iou_ceiling")
    scores = {key: {"cape": 0.9, "mean": 0.9} for key in keys}
    rows = mask_rows({"flower": SUMMARY, "goldcape": SUMMARY | scores | {"coarse_masks": {"cape": []}}})
    assert rows[2:] == ["| goldcape: cape | 0.900 | 0.900 | 0.900 | 0.900 |"]


def test_the_page_has_the_tables_that_the_command_prints():
    page = (DOCS / "benchmark.md").read_text(encoding="utf-8")
    for rows in (picture_rows({}), mask_rows({})):
        assert rows[0] in page
    for name in CAPTURES:
        assert f"| {name} |" in page
