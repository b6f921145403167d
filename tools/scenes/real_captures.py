"""Learn and judge four captures of the real world that others have published: OUT/real_captures.json and tables.

    .venv/engine/bin/python -m tools.scenes.real_captures FOLDER --out OUT [NAME ...] [--preset fast] [--threads N]

FOLDER/<name> is a capture of `CAPTURES`: flower, fruit, bonsai, goldcape. None may be passed on with this repository, so
whoever wants the figures fetches them where their authors publish them, and brings them into the layout that `CAPTURES`
tells and `--list` prints. What lacks is said before anything is learned.

Every 8th photo is held out and judged, each capture as by `judge_capture`: geometry, splats and segmentation are learned
once, from the others and one mask an object, drawn over the true one as a hasty hand would. True masks are the source's
own, or derived by color (`color_masks`) into OUT/<name>/masks. In the same OUT only what has changed is learned again, and
the tables are of all that was judged there.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import karf_engine as karf
from karf_engine.io.files import read_json, write_json
from karf_engine.io.images import read_photo, write_png
from karf_engine.project.settings import PRESETS

from . import judge_capture
from .color_masks import ColorRule, masks_by_color


@dataclass(frozen=True)
class RealCapture:
    """A capture that others have published.

    shows: what it is. source: who has published it, and where. licence: as stated there. photos: how many, and their
    pattern below the capture's folder. files: what else must be there. preparation: how what is published becomes that.
    rules: objects whose true masks are derived by color. masks: the folder of the source's own masks, one of each object
    below it.
    """

    shows: str
    source: str
    licence: str
    photos: tuple[int, str]
    files: tuple[str, ...]
    preparation: str
    rules: Mapping[str, ColorRule] = field(default_factory=dict)
    masks: str | None = None

    def lacks(self, folder: Path) -> list[str]:
        """What is not as it should be in the capture's folder, a sentence each."""
        count, pattern = self.photos
        found = len(list(folder.glob(pattern)))
        missing = [f"{folder / name} is missing." for name in self.files if not (folder / name).exists()]
        if found != count:
            missing.append(f"{folder / pattern} are {found} photos in the place of {count}.")
        if self.masks is not None and not any((folder / self.masks).glob("*/*.png")):
            missing.append(f"{folder / self.masks}/<object>/<photo stem>.png, the source's own masks, are missing.")
        return missing

    def story(self, name: str) -> str:
        """What one must know to make its folder."""
        files = ", ".join([self.photos[1], *self.files, *([f"{self.masks}/*/*.png"] if self.masks else [])])
        return f"{name}: {self.shows}. {self.source}; licence: {self.licence}. {self.preparation} Layout: {files}."


CAPTURES = {
    "flower": RealCapture(
        shows="a blossom from the front",
        source="LLFF's flower (Mildenhall et al. 2019), as published with NeRF: nerf_llff_data of "
        "https://www.matthewtancik.com/nerf",
        licence="none stated with the photos",
        photos=(34, "images_8/*.png"),
        files=("poses_bounds.npy",),
        preparation="The photos reduced to an eighth, 504 x 378, by Lanczos; poses_bounds.npy as it is.",
        rules={"blossom": ColorRule((335, 50), saturation=0.3, value=0.3)},
    ),
    "fruit": RealCapture(
        shows="an apple and a banana on a table",
        source="https://github.com/tusharparimi/fruit-NeRF at 236cb01",
        licence="none stated",
        photos=(81, "newfruit_small/*.jpg"),
        files=("transforms.json",),
        preparation="As it is.",
        rules={
            "apple": ColorRule((345, 20), saturation=0.5, value=0.25),
            "banana": ColorRule((40, 75), saturation=0.42, value=0.3),
        },
    ),
    "bonsai": RealCapture(
        shows="a whole room",
        source="Mip-NeRF 360's bonsai (Barron et al. 2022): 360_v2 of https://jonbarron.info/mipnerf360",
        licence="none stated with the photos",
        photos=(146, "images/*.JPG"),
        files=("sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin"),
        preparation="Every second photo, DSCF5565 to DSCF5855, reduced to 800 x 533; sparse/0 is COLMAP's model of these "
        "photos (`karf poses`). The authors' own poses are of all 292 photos: other photos are then held out.",
    ),
    "goldcape": RealCapture(
        shows="a gold relief all round through a long lens",
        source="https://github.com/vork/moldGoldCape at c7ef1f0",
        licence="CC BY-NC-SA 4.0",
        photos=(119, "images_8/*.jpg"),
        files=("poses_bounds.npy",),
        preparation="Photos and masks reduced to an eighth, 456 x 456; poses_bounds.npy as it is.",
        masks="masks_gt",
    ),
}


def main() -> None:
    options = parse_arguments()
    names = options.names or list(CAPTURES)
    if options.list:
        print("\n\n".join(CAPTURES[name].story(name) for name in names))
        return
    check(options.folder, names)
    for name in names:
        judge(name, options)
    summaries = {name: options.out / name / "summary.json" for name in CAPTURES}
    judged = {name: read_json(path, "summary") for name, path in summaries.items() if path.exists()}
    made = {"preset": options.preset, "version": karf.__version__}
    write_json(options.out / "real_captures.json", made | {"captures": judged})
    print("\n" + "\n".join([*picture_rows(judged), "", *corrected_rows(judged), "", *mask_rows(judged)]))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="folder of the captures' folders")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"default: all, {', '.join(CAPTURES)}")
    parser.add_argument("--out", type=Path, help="folder for everything written")
    parser.add_argument("--preset", default="fast", choices=tuple(PRESETS))
    parser.add_argument("--threads", type=int)
    parser.add_argument("--list", action="store_true", help="say where each is published and what its folder holds")
    options = parser.parse_intermixed_args()
    unknown = [name for name in options.names if name not in CAPTURES]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; choose from {', '.join(CAPTURES)}")
    if not options.list and (options.folder is None or options.out is None):
        parser.error("FOLDER and --out are needed")
    return options


def check(folder: Path, names: list[str]) -> None:
    """End with what lacks of these captures, and where it is published."""
    found = {name: CAPTURES[name].lacks(folder / name) for name in names}
    lines = [line for name, lacks in found.items() if lacks for line in (*lacks, CAPTURES[name].story(name), "")]
    if lines:
        sys.exit("\n".join(lines).rstrip())


def judge(name: str, options: argparse.Namespace) -> dict[str, Any]:
    """Learn and judge one capture in OUT/<name>; returns the summary."""
    capture, out = options.folder / name, options.out / name
    return judge_capture.judge(
        argparse.Namespace(
            capture=capture,
            truth=true_masks(CAPTURES[name], capture, out / "masks"),
            out=out,
            preset=options.preset,
            overrides=[],
            seed=0,
            masks_each=1,
            threads=options.threads,
        )
    )


def true_masks(known: RealCapture, capture: Path, out: Path) -> Path | None:
    """The folder of a capture's true masks: the source's own, or `out`, where masks by color are written to; or none."""
    if known.masks is not None:
        return capture / known.masks
    if not known.rules:
        return None
    for view in karf.open_capture(capture).views:
        for name, mask in masks_by_color(read_photo(view.image)[..., :3], known.rules).items():
            write_png(out / name / f"{view.stem}.png", mask)
    return out


# ---------------------------------------------------------------------------------------------------------------- tables
def picture_rows(judged: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """How held-out photos are shown, mean and worst, and what learning that takes: a table in Markdown."""
    titles = ("capture", "voxels", "splats", "splats, exposed", "seconds: voxels", "splats", "masks", "peak memory")
    rows = []
    for name, summary in judged.items():
        splats, seconds = summary["splats"], summary["stage_seconds"]
        pairs = (
            (summary["psnr_full"], summary["psnr_full_worst"]),
            (splats["psnr"], splats["psnr_worst"]),
            (splats["psnr_exposed"], splats["psnr_exposed_worst"]),
        )
        taken = [
            f"{seconds[stage]:.0f}" if stage in seconds else "" for stage in ("geometry", "splats", "segmentation")
        ]
        pictures = [f"{mean:.1f}, {worst:.1f} dB" for mean, worst in pairs]
        rows.append([name, *pictures, *taken, f"{summary['peak_memory'] / 2**30:.1f} GiB"])
    return markdown(titles, rows)


def corrected_rows(judged: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """How held-out photos are shown, mean and worst, plainly and color-corrected: a table in Markdown.

    Captures that an earlier version judged have no such figures, and no row.
    """
    titles = ("capture", "voxels", "voxels, corrected", "splats", "splats, corrected")
    rows = []
    for name, summary in judged.items():
        if "cc_psnr_full" not in summary:
            continue
        splats = summary["splats"]
        pairs = (
            (summary["psnr_full"], summary["psnr_full_worst"]),
            (summary["cc_psnr_full"], summary["cc_psnr_full_worst"]),
            (splats["psnr"], splats["psnr_worst"]),
            (splats["cc_psnr"], splats["cc_psnr_worst"]),
        )
        rows.append([name, *(f"{mean:.1f}, {worst:.1f} dB" for mean, worst in pairs)])
    return markdown(titles, rows)


def mask_rows(judged: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """How right the masks of held-out photos are: a table in Markdown."""
    keys = ("iou", "iou_worst_view", "iou_border_excluded", "iou_ceiling")
    rows = [
        [f"{name}: {object_name}", *(f"{summary[key][object_name]:.3f}" for key in keys)]
        for name, summary in judged.items()
        for object_name in summary.get("coarse_masks", {})
    ]
    return markdown(("masks", "IoU", "worst view", "border left out", "ceiling"), rows)


def markdown(titles: tuple[str, ...], rows: list[list[str]]) -> list[str]:
    """The lines of a table."""
    return [f"| {' | '.join(cells)} |" for cells in (titles, ["---"] * len(titles), *rows)]


if __name__ == "__main__":
    main()
