"""What the command line takes: verbs, arguments and their help."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from ..commands.farm.options import PER_TASK, PYTHON
from ..project.settings import PRESETS
from ..version import __version__
from . import farm, verbs

Commands = argparse._SubParsersAction


def make_parser() -> argparse.ArgumentParser:
    """The parser; what it gives has the verb's function as `action`."""
    parser = argparse.ArgumentParser(
        prog="karf_engine",
        description="KaRF: segment objects in a captured scene from coarse masks and recolor them by palettes.",
        epilog="Exit codes: 0 done, 2 bad request, 3 missing dependency, 4 bad data, 5 out of memory, 6 cancelled, "
        "7 diverged, 70 internal error.",
    )
    parser.add_argument("--version", action="version", version=f"karf_engine {__version__}")
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    _add_learning(commands)
    _add_editing(commands)
    _add_farm(commands)
    _add_others(commands)
    return parser


def _add_learning(commands: Commands) -> None:
    verb = _verb(commands, "poses", "make a capture of photos without camera poses, or of a video", verbs.find_poses)
    verb.add_argument("photos", metavar="PHOTOS", help="folder of photos, or a video file")
    verb.add_argument("--out", required=True, metavar="DIR", help="the new capture's folder")
    verb.add_argument("--matching", default="auto", choices=("auto", "exhaustive", "sequential"), help="which pairs of "
                      "photos are compared: all, or neighbors by name (default: all of up to 250)")  # fmt: skip

    verb = _verb(commands, "mark", "write the mask of an object in one photo, from a box or clicks", verbs.mark)
    verb.add_argument("capture", metavar="CAPTURE", help="folder or transforms.json with photos and camera poses")
    verb.add_argument("--view", required=True, metavar="NAME", help="which photo")
    verb.add_argument("--object", required=True, metavar="NAME", help="what the object is called")
    verb.add_argument(
        "--box", type=_numbers(4), metavar="X0,Y0,X1,Y1", help="a frame that it lies in, pixels of the photo"
    )
    verb.add_argument("--click", dest="clicks", type=_numbers(2), action="append", default=[], metavar="X,Y",
                      help="a pixel that shows it; may be repeated")  # fmt: skip
    verb.add_argument("--not", dest="nots", type=_numbers(2), action="append", default=[], metavar="X,Y",
                      help="a pixel that does not; may be repeated")  # fmt: skip
    verb.add_argument("--out", required=True, metavar="MASKS", help="write MASKS/<object>/<view>.png")
    verb.add_argument("--weights", metavar="DIR", help="a Segment Anything model's folder; needs the extra marks")

    verb = _verb(commands, "all", "learn everything: geometry, segmentation, palette, recoloring", verbs.learn_all)
    _add_geometry_options(verb)
    verb.add_argument("--masks", required=True, metavar="DIR", help="coarse masks: DIR/<object>/<photo stem>.png")
    verb.add_argument("--project", required=True, metavar="DIR", help="project folder, made if needed")

    verb = _verb(commands, "geometry", "learn the scene from photos with poses", verbs.learn_geometry)
    _add_geometry_options(verb)
    verb.add_argument("--masks", metavar="DIR", help="coarse masks, whose photos are learned from in any case")
    verb.add_argument("--project", required=True, metavar="DIR", help="project folder, made if needed")

    verb = _verb(commands, "segmentation", "turn coarse masks into objects in all views", verbs.segment)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--masks", metavar="DIR", help="coarse masks: DIR/<object>/<photo stem>.png (default: the "
                      "project's own)")  # fmt: skip
    verb.add_argument("--suggest", action="store_true", help="print the views to mark next, with their scores, the best "
                      "first, and how unsure each object is; nothing is computed")  # fmt: skip
    verb.add_argument("--volumes", metavar="FILE", help="boxes and meshes that objects must be inside or outside of "
                      "(default: the project's own volumes.json)")  # fmt: skip
    verb.add_argument("--corrections", metavar="DIR", help="partial marks: DIR/<object>/<view>.png, gray with alpha "
                      "(default: the project's own)")  # fmt: skip

    verb = _verb(
        commands, "palette", "extract palettes; with --json or --out only show the learned ones", verbs.extract_palettes
    )
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--json", action="store_true", help="print the palettes as JSON; nothing is computed")
    verb.add_argument(
        "--out", metavar="FILE", help="write their colors as .gpl, .ase or EDIT.json; nothing is computed"
    )
    verb.add_argument("--edit", metavar="FILE", help="of --out: the colors that an edit or a palette file gives them")

    verb = _verb(commands, "recoloring", "learn palette weights", verbs.learn_recoloring)
    verb.add_argument("project", metavar="DIR", help="project folder")


def _add_editing(commands: Commands) -> None:
    text = "write the edit with which one color of an object becomes another, or a view looks as it was painted"
    verb = _verb(commands, "match", text, verbs.match)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--object", help="which object")
    verb.add_argument("--from", dest="source", metavar="COLOR", help="a color it shows, #rrggbb")
    verb.add_argument("--to", dest="target", metavar="COLOR", help="the color it shall become, #rrggbb")
    verb.add_argument("--also", nargs=2, action="append", default=[], metavar=("FROM", "TO"), help="another paint of "
                      "the object and what it becomes; all pairs are solved together (may be repeated)")  # fmt: skip
    verb.add_argument("--rule", default="becomes", choices=("becomes", "fewest", "added"), help="becomes: the whole "
                      "material; fewest: as few swatches as possible; added: this pigment alone, by a color that is "
                      "added to the swatches (default: %(default)s)")  # fmt: skip
    verb.add_argument("--view", help="in place of a color pair: the view that --picture shows")
    verb.add_argument("--picture", metavar="FILE", help="this view painted over or graded, of any size")
    verb.add_argument("--edit", metavar="FILE", help="start from this edit (one call an object); with "
                      "--picture the one that was painted on")  # fmt: skip
    verb.add_argument("--out", required=True, metavar="FILE", help="EDIT.json to write")

    verb = _verb(commands, "render", "render masks, pictures and recolored frames", verbs.render)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument(
        "--views", default="all", help="train, test, val, all, names with commas, or CAMERAS.json (transforms.json "
        "with sizes) (default: %(default)s)",
    )  # fmt: skip
    verb.add_argument("--first", type=int, metavar="N", help="the first of these views to write, counted from 1")
    verb.add_argument("--last", type=int, metavar="N", help="the last one")
    verb.add_argument("--count", type=int, metavar="N", help="how many at most")
    verb.add_argument("--edit", metavar="FILE", help="EDIT.json, a palette file, or a folder with <view>.json for each "
                      "view: write recolored frames too")  # fmt: skip
    verb.add_argument("--out", required=True, metavar="DIR", help="folder for render/, masks/, recolor/")
    _add_picture_options(verb)
    verb.add_argument("--planes", action="store_true", help="write planes/ too (what Blender recolors from)")
    _add_overrides(verb, "change one setting of render, as render.edges=field; may be repeated")
    verb.add_argument("--skip-existing", action="store_true", help="keep frames that are there already, made from the "
                      "same: goes on where a job was stopped")  # fmt: skip

    verb = _verb(commands, "colorways", "render every colorway of a sheet in every view", verbs.render_colorways)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--sheet", required=True, metavar="FILE", help="CSV or JSON: colorway, object, and a color as hex, "
                      "lab, srgb or srgb8")  # fmt: skip
    verb.add_argument("--views", default="all", help="as for render (default: %(default)s)")
    verb.add_argument("--out", required=True, metavar="DIR", help="folder for <colorway>/, colorways.csv and the contact "
                      "sheet; pictures that are there already are not made again")  # fmt: skip
    verb.add_argument("--size", default="photo", help="as for render (default: %(default)s)")
    verb.add_argument("--predict-only", action="store_true", help="only write colorways.csv: what will be reached")

    verb = _verb(commands, "points", "write the scene as points on its surface", verbs.write_points)
    verb.add_argument("project", metavar="DIR", help="project folder")
    verb.add_argument("--out", required=True, metavar="FILE", help=".ply: colored points; .npz: with what recoloring "
                      "them needs")  # fmt: skip
    verb.add_argument("--count", type=int, default=60_000, help="about how many points (default: %(default)s)")
    verb.add_argument("--edit", metavar="FILE", help="EDIT.json or a palette file: a .ply gets these colors")


def _add_picture_options(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("--base", choices=("photo", "render"), help="what an edit of a captured view changes (default: "
                      "photo; with the preset paper: render)")  # fmt: skip
    verb.add_argument("--size", default="photo", help="of masks and recolored pictures of captured views: photo (all its "
                      "pixels), learned, or the long side in pixels (default: %(default)s)")  # fmt: skip
    verb.add_argument("--jpeg", action="store_true", help="write recolored JPEG photos as JPEG, not as PNG")
    verb.add_argument("--alpha", action="store_true", help="renderings without what is behind the scene, with alpha")
    verb.add_argument("--format", choices=("png8", "png16", "exr16", "exr32"), default="png8", help="of recolored "
                      "frames of new cameras; exr is scene-linear (default: %(default)s)")  # fmt: skip
    verb.add_argument("--depth", action="store_true", help="write depth/ too")
    verb.add_argument(
        "--unsure", action="store_true", help="write unsure/ too: where objects' labels are unsure, white"
    )
    verb.add_argument("--layers", action="store_true", help="write layers/ too (OpenEXR for compositors)")


def _add_farm(commands: Commands) -> None:
    text = "write a job for a render farm: a folder by the Open Job Description specification"
    verb = _verb(commands, "farm", text, farm.write_bundle)
    verb.add_argument("source", metavar="SOURCE", help="project folder; with --masks, a capture that is learned first")
    verb.add_argument("--out", required=True, metavar="DIR", help="the bundle's folder, new or empty")
    verb.add_argument("--masks", metavar="DIR", help="learn SOURCE first, with these coarse masks")
    verb.add_argument("--preset", choices=tuple(PRESETS), help="with --masks: quality against time (default: demo)")
    verb.add_argument("--holdout", type=int, default=0, metavar="N", help="with --masks: hold out every Nth photo, as "
                      "for geometry (default: none)")  # fmt: skip
    _add_overrides(verb, "change one setting (see the settings verb); may be repeated")
    verb.add_argument("--views", default="all", help="as for render (default: %(default)s)")
    verb.add_argument("--edit", metavar="FILE", help="as for render: recolored frames too")
    verb.add_argument(
        "--per-task", type=int, default=PER_TASK, metavar="N", help="frames a task (default: %(default)s)"
    )
    verb.add_argument("--python", default=PYTHON, help="of the farm's machines, with the engine's packages (default: "
                      "%(default)s)")  # fmt: skip
    _add_picture_options(verb)


def _add_others(commands: Commands) -> None:
    verb = commands.add_parser("settings", help="list all settings with defaults and ranges")
    verb.set_defaults(action=verbs.list_settings)
    verb = _verb(commands, "doctor", "say whether this Python can run the engine, and what to do if not", verbs.doctor)
    verb.add_argument("--json", action="store_true", help="print each finding as a line of JSON, as it is found")
    verb.add_argument("--quick", action="store_true", help="do not try the stages, which takes some seconds")
    verb.add_argument("--folder", metavar="DIR", default=".", help="where projects shall lie: its disk and its locks are "
                      "tried (default: here)")  # fmt: skip
    verb = _verb(commands, "speed", "measure how fast this computer learns, in some seconds", verbs.speed)
    verb = commands.add_parser("run", help="run a job folder (used by Blender)")
    verb.add_argument("job", metavar="JOB", help="folder with request.json")
    verb.add_argument("--map", dest="folders", action="append", default=[], metavar="CALLERS=OURS", help="a folder that "
                      "the caller knows by another path; may be repeated")  # fmt: skip
    verb.add_argument("--wait", type=float, default=0, metavar="SECONDS", help="after a job that is done, wait so long "
                      "for the folder of a next one, as a line of JSON on standard input")  # fmt: skip
    verb.set_defaults(action=verbs.run)


def _numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    """Reads so many numbers with commas between them."""

    def read(text: str) -> tuple[float, ...]:
        numbers = tuple(map(float, text.split(",")))
        if len(numbers) != count:
            raise ValueError(text)
        return numbers

    read.__name__ = f"list of {count} numbers"  # argparse names it where a value cannot be read
    return read


def _verb(commands, name: str, text: str, action: Callable) -> argparse.ArgumentParser:
    verb = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    verb.set_defaults(action=action)
    verb.add_argument("--threads", type=int, help="processor threads (default: all cores, at most 4)")
    verb.add_argument("--device", help="cpu, cuda or cuda:NUMBER (default: cuda where there is one)")
    return verb


def _add_geometry_options(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("capture", metavar="CAPTURE", help="folder or transforms.json with photos and camera poses")
    verb.add_argument("--holdout", type=int, metavar="N", help="hold out every Nth photo, unless it is marked, to test "
                      "what is learned, where the capture declares no test photos (default: as the project was learned, "
                      "else none)")  # fmt: skip
    verb.add_argument("--preset", default="demo", choices=tuple(PRESETS), help="quality against time (default: demo)")
    _add_overrides(verb, "change one setting (see the settings verb); may be repeated")
    verb.add_argument("--nerf", metavar="FILE", help="import a NeRF that another program has trained on this capture: "
                      "nerf-pytorch .tar, krrish94 .ckpt")  # fmt: skip


def _add_overrides(verb: argparse.ArgumentParser, text: str) -> None:
    verb.add_argument(
        "--set", dest="overrides", action="append", default=[], metavar="STAGE.FIELD=VALUE", help=text
    )  # fmt: skip
