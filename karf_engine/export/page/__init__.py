"""A web page that recolors a scene's Gaussians in the browser: `karf-page/1`, see docs/files.md.

The viewer is a bundle that `python3 tools/dev.py page` builds, a release has it.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...errors import MissingDependency
from ...io.color import to_bytes
from ...io.files import write_json
from ...io.images import encode_image
from ...palettes.added import extended_palettes
from ...palettes.edge_shape import active_edges
from ...palettes.palette import Edit, edit_to_json
from ...recolor.model import Model
from ...recolor.splatted_scene import SplattedScene
from ...splats.formats.registry import write_splats
from ...splats.formats.splat_file import SplatFile, upright
from ...splats.gaussians import Gaussians
from ...splats.kernels.arrays import PLAIN_FILTER
from .orbit import Orbit

SCHEMA = "karf-page/1"
SPLATS = "scene.spz"
UPRIGHT_ENDS = (".spz",)  # kinds of files that are written a half turn about x
INDEX, SCRIPT, LICENSES, CONTENT, SEEN, STILLS = (
    "index.html",
    "page.js",
    "licenses.txt",
    "page.json",
    "seen.bin.gz",
    "stills",
)
BUNDLE = Path(__file__).parent / "web" / "dist"
FILES = re.compile(
    r"index\.html|page\.js|licenses\.txt|page\.json|stills|scene\.\w+|logo\.\w+|(weights_\d+|seen)\.bin\.gz"
)
STILL_SIZE, STILL_QUALITY = (480, 360), 90  # pixels, and of WebP
ENDS_SCRIPT = re.compile(r"<(?=/script|!--)", re.IGNORECASE)  # of a script within HTML


@dataclass(frozen=True)
class Look:
    """A named edit."""

    name: str
    edit: Edit


@dataclass(frozen=True)
class Heading:
    """The title, studio and logo of a page."""

    title: str
    studio: str = ""
    logo: Path | None = None


@dataclass(frozen=True)
class Shown:
    """The part of a model's splats that a page shows."""

    rows: np.ndarray  # [n], of the model's splats
    gaussians: Gaussians  # these rows
    orbit: Orbit


def check_bundle() -> None:
    """Raise MissingDependency where the viewer has not been built."""
    for name in (INDEX, SCRIPT, LICENSES):
        if not (BUNDLE / name).is_file():
            raise MissingDependency(
                "The viewer of web pages is not built: {path} is missing.",
                "Install the extension from a release, or build it in the source code: python3 tools/dev.py page",
                path=BUNDLE / name,
            )


def is_page(folder: Path) -> bool:
    """Return whether a folder has a page and nothing else."""
    names = [path.name for path in folder.iterdir()]
    return INDEX in names and all(FILES.fullmatch(name) for name in names)


def write_page(
    folder: Path,
    model: Model,
    shown: Shown,
    looks: Sequence[Look],
    heading: Heading,
    locked: Mapping[str, Sequence[int]],
    step: Callable[[], None],
) -> None:
    """Write a page's files into an empty folder.

    looks: the first is the scene as learned. locked: swatches that the page does not offer, by object. step: called
    after each look; may raise Cancelled.
    """
    assert model.splatted is not None
    gaussians = shown.gaussians
    for name in (SCRIPT, LICENSES):
        shutil.copyfile(BUNDLE / name, folder / name)
    title = f"<title>{html.escape(heading.title)}</title>"
    index = (BUNDLE / INDEX).read_text(encoding="utf-8")
    index = re.sub(r"<title>.*?</title>", lambda _: title, index, count=1, flags=re.DOTALL)
    (folder / INDEX).write_text(index, encoding="utf-8", newline="\n")
    logo = None if heading.logo is None else f"logo{heading.logo.suffix.lower()}"
    if heading.logo is not None:
        shutil.copyfile(heading.logo, folder / str(logo))
    _write_gaussians(folder / SPLATS, gaussians)
    fades = model.splatted.fade_unseen and gaussians.visibility is not None
    if fades:
        _write_arrays(folder / SEEN, [np.asarray(gaussians.visibility, "<f4")])
    variants, numbers = _write_variants(folder, model, shown.rows, looks)
    content = {
        "schema": SCHEMA,
        "title": heading.title,
        "studio": heading.studio,
        "logo": logo,
        "splats": {
            "file": SPLATS,
            "count": len(gaussians),
            "n_background": gaussians.n_background,
            "background": list(gaussians.background),
            "screen_filter": {name: float(value) for name, value in gaussians.screen_filter._asdict().items()},
            "near": gaussians.near,
            "unit": float(np.linalg.norm(shown.orbit.position - shown.orbit.center)),
        },
        "seen": SEEN if fades else None,
        "objects": [
            {
                "name": palette.name,
                "swatches": [
                    {"index": index, "color": color, "locked": index == 0 or index in locked.get(palette.name, ())}
                    for index, color in enumerate(_numbers(palette.colors))
                ],
            }
            for palette in model.palettes
        ],
        "variants": variants,
        "looks": _write_stills(folder, model.splatted, shown.orbit, looks, numbers, step),
        "orbit": {name: _numbers(value) for name, value in asdict(shown.orbit).items()},
    }
    write_json(folder / CONTENT, content)


def make_single(folder: Path) -> None:
    """Put all files of a page into its index.html."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and path.name not in (INDEX, SCRIPT))
    files = {path.relative_to(folder).as_posix(): base64.b64encode(path.read_bytes()).decode() for path in paths}
    script = ENDS_SCRIPT.sub(r"\\x3c", (folder / SCRIPT).read_text(encoding="utf-8"))
    data = f'<script type="application/json" id="karf-files">{json.dumps(files)}</script>\n'

    def inline(tag: re.Match[str]) -> str:
        return f"{data}<script{tag[1]}{tag[2]}>{script}</script>"

    tag = rf'<script([^>]*?)\s+src="(?:\./)?{re.escape(SCRIPT)}"([^>]*)></script>'
    index, count = re.subn(tag, inline, (folder / INDEX).read_text(encoding="utf-8"))
    assert count == 1, f"{INDEX} of the bundle loads {SCRIPT} {count} times"
    (folder / INDEX).write_text(index, encoding="utf-8", newline="\n")
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name != INDEX:
            path.unlink()


def _write_gaussians(path: Path, gaussians: Gaussians) -> None:
    """Write the Gaussians with the axes of the capture's world."""
    table = upright(gaussians.table) if path.suffix in UPRIGHT_ENDS else gaussians.table
    write_splats(path, SplatFile(table, gaussians.screen_filter != PLAIN_FILTER))


def _write_variants(
    folder: Path, model: Model, rows: np.ndarray, looks: Sequence[Look]
) -> tuple[list[dict[str, Any]], list[int]]:
    """Write the weights of all edits, once for each set of added colors and edges; return these, and each look's."""
    assert model.splatted is not None
    numbers = np.full(len(model.splatted.gaussians), -1)
    numbers[rows] = np.arange(len(rows))
    keys = [repr((active_edges(look.edit.edges), look.edit.added)) for look in looks]
    variants = []
    for key in dict.fromkeys(keys):
        edit = looks[keys.index(key)].edit
        file, arrays, objects = f"weights_{len(variants)}.bin.gz", [], []
        palettes = extended_palettes(model.palettes, edit.added)
        for own, palette in zip(model.splatted.objects_of(edit), palettes, strict=True):
            kept = numbers[own.rows] >= 0
            arrays.append(numbers[own.rows][kept].astype("<u4"))
            arrays += [values[kept].astype("<f2") for values in (own.shares, own.weights, own.slopes)]
            size = {"rows": int(kept.sum()), "colors": len(palette.colors)}
            objects.append({"name": palette.name, **size, "learned": _numbers(palette.colors)})
        _write_arrays(folder / file, arrays)
        variants.append({"file": file, "objects": objects})
    unique = list(dict.fromkeys(keys))
    return variants, [unique.index(key) for key in keys]


def _write_stills(
    folder: Path,
    splatted: SplattedScene,
    orbit: Orbit,
    looks: Sequence[Look],
    variants: Sequence[int],
    step: Callable[[], None],
) -> list[dict[str, Any]]:
    """Write a picture of each look at the start, and return the looks as JSON. variants: the number of each one's."""
    (folder / STILLS).mkdir()
    entries, camera = [], orbit.camera(*STILL_SIZE)
    for number, (look, variant) in enumerate(zip(looks, variants, strict=True)):
        file = f"{STILLS}/{number}.webp"
        picture = to_bytes(splatted.render_recolored(camera, look.edit))
        (folder / file).write_bytes(encode_image(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, STILL_QUALITY]))
        colors = {name: _numbers(colors) for name, colors in look.edit.colors.items()}
        entry = {"name": look.name, "still": file, "variant": variant, "colors": colors}
        entries.append({**entry, "edit": edit_to_json(look.edit)})
        step()
    return entries


def _write_arrays(path: Path, arrays: Sequence[np.ndarray]) -> None:
    """Write the bytes of arrays one after another, compressed."""
    path.write_bytes(gzip.compress(b"".join(array.tobytes() for array in arrays), mtime=0))


def _numbers(values: Any) -> Any:
    """Return numbers of any shape as JSON values, to six decimals; None as it is."""
    return None if values is None else np.asarray(values, np.float64).round(6).tolist()
