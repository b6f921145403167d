"""The library's contract as a table: every public name, what each of its arguments is, and how each kind is misused.

A name that is not in `ROWS`, an argument that its row leaves out, and a kind without misuses fail the test.
"""

from __future__ import annotations

import inspect
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch

import karf_engine as karf
from karf_engine import kan
from karf_engine.palettes.edge_shape import EdgeShape
from karf_engine.palettes.project_edit import ProjectEdit
from karf_engine.recolor.full_resolution import PhotoView

NAN = float("nan")
CLASSES = {"ProjectEdit": ProjectEdit, "PhotoView": PhotoView}  # that public functions give
VALUES = ("PRESETS", "__version__", "kan.LAYERS", "kan.VARIANTS")  # nothing that could be called
ANY_TYPE = "anything may be given"


@dataclass(frozen=True)
class Bench:
    """What right arguments are taken from; nothing in its folder may change.

    Attributes:
        folder: Of copies of a capture, its masks and its learned project.
        project: The project.
        model: It, loaded.
    """

    folder: Path
    project: Path
    model: karf.Model

    @classmethod
    def of(cls, capture: Path, masks: Path, project: Path, folder: Path) -> Bench:
        """Of copies in a new folder."""
        for source, name in ((capture, "capture"), (masks, "masks"), (project, "project")):
            shutil.copytree(source, folder / name)
        (folder / "sheet.csv").write_text("colorway,object,color\nblue,ball,#2030c0\n")
        (folder / "book.csv").write_text("name,hex\nRed,#ff0000\n")
        bench = cls(folder, folder / "project", karf.load(folder / "project", device="cpu"))
        bench.model.edit().save(folder / "edit.json")
        _ = bench.frame, bench.photo_view  # what they keep is there
        return bench

    @cached_property
    def capture(self) -> karf.Capture:
        """The capture."""
        return self.model.capture

    @cached_property
    def view(self) -> karf.View:
        """One of its views."""
        return self.capture.split("train")[0]

    @cached_property
    def camera(self) -> karf.Camera:
        """The view's, small."""
        return self.view.camera.reduced(8)

    @cached_property
    def frame(self) -> karf.Frame:
        """A small picture of the model."""
        return self.model.render(self.camera)

    @cached_property
    def photo_view(self) -> PhotoView:
        """The view's photo, ready to be recolored."""
        return self.model.photo_view(self.view)


Make = Callable[[Bench], Any]


@dataclass(frozen=True)
class Kind:
    """A kind of argument.

    Attributes:
        right: A right one.
        wrong: Misuses by name, each a list of wrong ones.
        answered: Names of misuses that may be answered: what comes of them is right, or says itself that it is not.
    """

    right: Make
    wrong: Mapping[str, list[Make]]
    answered: tuple[str, ...] = ()


def kind(right: Make | Any, answered: tuple[str, ...] = (), **wrong: list[Any]) -> Kind:
    """A kind of argument of values, or of functions that make them of a bench; `_` in a misuse's name is a space."""
    made = {name.replace("_", " "): [_made(each) for each in values] for name, values in wrong.items()}
    return Kind(_made(right), made, answered)


def _made(value: Any) -> Make:
    return value if inspect.isfunction(value) else lambda bench: value


def camera_with(**values: Any) -> Make:
    """The bench's camera with other numbers."""
    return lambda bench: replace(bench.camera, **values)


def posed(change: Callable[[np.ndarray], None]) -> Make:
    """The bench's camera with its pose changed in place."""

    def make(bench: Bench) -> karf.Camera:
        pose = bench.camera.camera_to_world.copy()
        change(pose)
        return replace(bench.camera, camera_to_world=pose)

    return make


def _edit_with(value: float, name: str | None = None) -> Make:
    def make(bench: Bench) -> karf.Edit:
        edit = bench.model.edit()
        colors = {each: np.full_like(edit.colors[each], value) for each in edit.colors}
        return karf.Edit(colors if name is None else colors | {name: colors["ball"]})

    return make


def tensors(*shape: int, **options: Any) -> Kind:
    """Kind of a layer's input [n, C]; the layer answers no rows with none, and not-a-number with itself."""
    return kind(
        torch.zeros(*shape),
        ("NaN", "empty"),
        wrong_type=[None, [[0.0] * shape[-1]], np.zeros(shape, np.float32), torch.zeros(shape, dtype=torch.int64), torch.zeros(shape, dtype=torch.float64)],
        wrong_shape=[torch.zeros(*shape[:-1], shape[-1] + 1), torch.tensor(0.0)],
        wrong_device=[torch.zeros(shape, device="meta")],
        NaN=[torch.full(shape, NAN)],
        empty=[torch.zeros(0, shape[-1])],
    )  # fmt: skip


TYPO = [lambda bench: bench.folder / "typo"]
PATH_TYPES = [None, 3, [], b"x", object()]
KINDS = {
    # paths and names
    "capture": kind(lambda b: b.folder / "capture", wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO),
    "masks": kind(lambda b: b.folder / "masks", wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO),
    "own masks": kind(lambda b: b.folder / "masks", wrong_type=PATH_TYPES[1:], empty=["", "\0"], missing=TYPO),
    "project": kind(lambda b: b.project, wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO, no_project=[lambda b: b.folder / "capture", lambda b: b.folder / "edit.json"]),
    "new folder": kind(lambda b: b.folder / "new", wrong_type=PATH_TYPES, empty=["", "\0"]),
    "new masks": kind(lambda b: b.folder / "new masks", wrong_type=PATH_TYPES, empty=["", "\0"]),
    "new mask": kind("pot", wrong_type=[None, 3, b"x"], empty=[""], path=["../pot", "a/b"]),
    "photos": kind(lambda b: b.folder / "capture", wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO),
    "splat": kind(lambda b: b.folder / "edit.json", wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO),
    "sheet": kind(lambda b: b.folder / "sheet.csv", wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO),
    "edit file": kind(lambda b: b.folder / "edit.json", wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO),
    "edit file or none": kind(lambda b: b.folder / "edit.json", wrong_type=PATH_TYPES[1:], empty=["", "\0"], missing=TYPO),
    "new edit file": kind(lambda b: b.folder / "new.json", wrong_type=PATH_TYPES, empty=["", "\0"],
                          ending=[lambda b: b.folder / "new.yaml"]),
    "new points": kind(lambda b: b.folder / "new.ply", wrong_type=PATH_TYPES, empty=["", "\0"],
                       ending=[lambda b: b.folder / "new.yaml"]),
    "book file": kind(lambda b: b.folder / "book.csv", wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO,
                      ending=[lambda b: b.folder / "edit.json"]),
    "book": kind(lambda b: karf.read_color_book(b.folder / "book.csv"), wrong_type=[None, 3, "book.csv", {}]),
    "color name": kind("Red", wrong_type=[None, 3, ["Red"]], empty=[""], missing=["typo"]),
    "three names": kind(("a", "b", "c"), wrong_type=["abc", None, 3, (3, 4, 5)], empty=[()], wrong_shape=[("a", "b")]),
    "rgb": kind(np.zeros(3), wrong_type=[None, "#ffffff", 3, np.full(3, "a")], wrong_shape=[np.zeros(2), np.zeros((2, 3))],
                NaN=[np.full(3, NAN)], empty=[np.zeros(0)]),
    "picture": kind(lambda b: b.view.image, wrong_type=PATH_TYPES, empty=["", "\0"], missing=TYPO),
    "path": kind(lambda b: b.folder / "capture", wrong_type=PATH_TYPES),
    "image": kind(None, wrong_type=PATH_TYPES[1:]),
    "text": kind("text", wrong_type=[None, 3, ["text"]]),
    "name": kind("r_0", wrong_type=[None, 3, ["r_0"]], empty=[""]),
    "view name": kind(lambda b: b.view.name, wrong_type=[None, 3, ["r_0"]], empty=[""], missing=["typo"]),
    "object": kind("ball", wrong_type=[None, 3, ["ball"]], empty=[""], missing=["typo"]),
    "split": kind("train", wrong_type=[None, 3], empty=[""], missing=["typo"]),
    "texts": kind((), wrong_type=["text", None, [3], (3,)]),
    "base": kind("photo", wrong_type=[3, object()], empty=[""], missing=["typo"]),
    "rule": kind("becomes", wrong_type=[None, 3], empty=[""], missing=["typo"]),
    "compositing": kind("delta", wrong_type=[None, 3], empty=[""], missing=["typo"]),
    "device": kind("cpu", wrong_type=[3, object()], empty=[""], wrong_device=["typo", "cuda:99", "meta"]),
    # numbers
    "flag": kind(True, wrong_type=["yes", 1.5, None, []]),
    "length": kind(8, wrong_type=["8", 1.5, None, [8], True], NaN=[NAN], empty=[0], negative=[-1]),
    "maybe length": kind(8, wrong_type=["8", 1.5, [8], True], NaN=[NAN], empty=[0], negative=[-1]),
    "width": kind(3, wrong_type=["3", 1.5, None, [3], True], NaN=[NAN], empty=[0], negative=[-1]),
    "width or 0": kind(3, wrong_type=["3", 1.5, None, [3], True], NaN=[NAN], negative=[-1]),
    "octaves": kind(2, wrong_type=["3", 1.5, None, [3], True], NaN=[NAN], negative=[-1]),
    "centers": kind(5, wrong_type=["5", 2.5, None, [5], True], NaN=[NAN], empty=[0, 1], negative=[-1]),
    "holdout": kind(0, wrong_type=["8", 1.5, None, [8], True], NaN=[NAN], negative=[-1, 1]),
    "seed": kind(0, wrong_type=["8", 1.5, None, [8], True], NaN=[NAN], negative=[-1]),
    "rays a pixel": kind(1, wrong_type=["2", 1.5, None, True], NaN=[NAN], empty=[0], negative=[-1], huge=[10**6]),
    "swatch": kind(1, wrong_type=["1", 1.5, None, True], NaN=[NAN], frozen=[0], negative=[-1], missing=[99]),
    "size": kind("photo", wrong_type=[None, 1.5, [8], object()], NaN=[NAN], empty=[0, ""], negative=[-1], missing=["typo"]),
    "focal length": kind(9.0, wrong_type=["9", None, [9]], NaN=[NAN, np.inf], empty=[0.0], negative=[-1.0]),
    "coordinate": kind(4.0, wrong_type=["4", None, [4]], NaN=[NAN, np.inf]),
    "protect": kind(0.2, wrong_type=["1", None, [1]], NaN=[NAN, np.inf], large=[1.0], negative=[-1.0]),
    "reach": kind(0.5, wrong_type=["1", None, [1]], NaN=[NAN, np.inf], empty=[0.0], negative=[-1.0]),
    "factor": kind(0.5, wrong_type=["1", None, [1]], NaN=[NAN, np.inf], negative=[-1.0], too_large=[99.0]),
    "stops": kind(0.5, wrong_type=["1", None, [1]], NaN=[NAN, np.inf], too_large=[99.0, -99.0]),
    "bandwidth": kind("eq5", wrong_type=[None, [1]], NaN=[NAN, np.inf], empty=["", 0.0], missing=["typo"], negative=[-1.0]),
    "distortion": kind((), wrong_type=["k", None, 3, ("k",)], NaN=[(NAN,)]),
    "bounds": kind((1.0, 2.0), wrong_type=[3, "12", (1.0,), ("1", "2")], NaN=[(NAN, 1.0)], swapped=[(2.0, 1.0)]),
    # arrays
    "pose": kind(np.eye(4), wrong_type=[None, "pose", np.eye(4).tolist(), np.full((4, 4), "a")], wrong_shape=[np.eye(3), np.zeros(16)],
                 NaN=[np.full((4, 4), NAN)], empty=[np.zeros((0, 4))]),
    "points": kind(np.zeros((2, 3)) - 1, wrong_type=[None, [[0, 0, 0]], "p", np.full((2, 3), "a")],
                   wrong_shape=[np.zeros(3), np.zeros((2, 2)), np.zeros((2, 2, 3))], NaN=[np.full((2, 3), NAN)],
                   empty=[np.zeros((0, 3))], answered=("NaN", "empty")),
    "pixels": kind(np.zeros((2, 2)), wrong_type=[None, [[0, 0]], "p", np.full((2, 2), "a")],
                   wrong_shape=[np.zeros(2), np.zeros((2, 3)), np.zeros((2, 2, 2))], NaN=[np.full((2, 2), NAN)],
                   empty=[np.zeros((0, 2))], answered=("NaN", "empty")),
    "palette": kind(np.zeros((3, 3)), wrong_type=[None, [[0, 0, 0]], "#ffffff", np.full((2, 3), "a")],
                    wrong_shape=[np.zeros(3), np.zeros((3, 2))], NaN=[np.full((3, 3), NAN)], empty=[np.zeros((0, 3))]),
    "base picture": kind(lambda b: b.frame.base, ("NaN",), wrong_type=[None, "b", lambda b: b.frame.base.tolist()],
                         wrong_shape=[np.zeros((2, 2)), np.zeros((3, 5, 3), np.float32)], empty=[np.zeros((0, 0, 3))],
                         NaN=[lambda b: b.frame.base * NAN]),
    "probabilities": kind(lambda b: b.frame.probabilities, ("NaN",), wrong_type=[None, "b", lambda b: b.frame.probabilities.tolist()],
                          wrong_shape=[np.zeros((2, 2)), np.zeros((2, 3, 5), np.float32)], empty=[np.zeros((0, 0, 0))],
                          NaN=[lambda b: b.frame.probabilities * NAN]),
    "weights": kind(lambda b: b.frame.palette_weights, ("NaN",), wrong_type=["b", 3, lambda b: b.frame.palette_weights.tolist()],
                    wrong_shape=[np.zeros((2, 2)), np.zeros((2, 3, 3, 5), np.float32)], empty=[np.zeros((0, 0, 0, 0))],
                    NaN=[lambda b: b.frame.palette_weights * NAN]),
    "depth": kind(lambda b: b.view.camera.height and np.ones((b.view.camera.height, b.view.camera.width), np.float32),
                  wrong_type=[None, "d", [[1.0]]], wrong_shape=[np.ones(3)], empty=[np.ones((0, 0))]),
    "color": kind("#2060a0", wrong_type=[None, 3, {}, object()], wrong_shape=[(0.1, 0.2), np.zeros((3, 3))],
                  NaN=[(NAN, 0.0, 0.0)], empty=["", ()], missing=["blue"], huge=[(9.0, 0.0, 0.0)]),
    "pairs": kind((), wrong_type=[None, 3, "ab", [("#ffffff",)], ["#ffffff"], [(1, 2)]], NaN=[[("#ffffff", (NAN, 0, 0))]]),
    "colors": kind(lambda b: b.model.edit().colors, wrong_type=[None, 3, [], {"ball": [[0, 0, 0]]}, {3: np.zeros((2, 3))}],
                   wrong_shape=[{"ball": np.zeros(3)}, {"ball": np.zeros((2, 4))}], NaN=[{"ball": np.full((2, 3), NAN)}],
                   empty=[{"ball": np.zeros((0, 3))}], huge=[{"ball": np.full((2, 3), 9.0)}]),
    "added": kind({}, wrong_type=[None, 3, [], {"ball": ["#ffffff"]}, {3: ()}]),
    "maybe added": kind(None, wrong_type=[3, [], {"ball": ["#ffffff"]}, {3: ()}]),
    "edges": kind({"ball": EdgeShape(1.0)}, wrong_type=[None, 3, [], {"ball": (1.0, 2.0)}, {3: EdgeShape()}]),
    "maybe edges": kind({"ball": EdgeShape(1.0)}, wrong_type=[3, [], {"ball": (1.0, 2.0)}, {3: EdgeShape()}]),
    "choke": kind(-1.5, wrong_type=["1", None, [1]], NaN=[NAN, np.inf], huge=[16.5, -17.0]),
    "feather": kind(4, wrong_type=["1", None, [1]], NaN=[NAN, np.inf], negative=[-1.0], huge=[65.0]),
    "grain": kind(0.5, wrong_type=["1", None, [1]], NaN=[NAN], negative=[-1.0]),
    "scale": kind(0.5, wrong_type=["1", None, [1]], NaN=[NAN], empty=[0.0], negative=[-1.0]),
    # things of the library
    "camera": kind(
        lambda b: b.camera, wrong_type=[None, 3, "r_0", lambda b: b.view, lambda b: b.camera.camera_to_world],
        wrong_shape=[camera_with(camera_to_world=np.eye(3))],
        NaN=[camera_with(fx=NAN), camera_with(cy=np.inf), posed(lambda pose: pose.fill(NAN)), posed(lambda pose: pose[0].fill(NAN))],
        empty=[camera_with(fx=0.0), camera_with(width=0), camera_with(height=0)],
        negative=[camera_with(fy=-5.0), camera_with(width=-8), posed(lambda pose: pose.__imul__([-1, 1, 1, 1]))],
        huge=[camera_with(width=10**9), posed(lambda pose: pose[:3, :3].__imul__(2))],
    ),
    "cameras": kind(lambda b: [each.camera for each in b.capture.views], wrong_type=[None, 3, "r_0", ["r_0"], lambda b: b.camera],
                    empty=[[]]),
    "elevation": kind(20.0, wrong_type=["1", [1]], NaN=[NAN, np.inf], too_large=[90.0, -99.0]),
    "fps": kind(24.0, wrong_type=["24", None, [1]], NaN=[NAN, np.inf], empty=[0.0], negative=[-1.0]),
    "frames": kind(lambda b: [b.frame.base], wrong_type=[None, 3, "f", ["f"], [None]], wrong_shape=[[np.zeros((2, 2))]], empty=[[]]),
    "new video": kind(lambda b: b.folder / "new.mp4", wrong_type=PATH_TYPES, empty=["", "\0"], ending=[lambda b: b.folder / "new.yaml"]),
    "view": kind(lambda b: b.view, wrong_type=[None, 3, "r_0", lambda b: b.camera, lambda b: b.capture]),
    "views": kind(lambda b: b.capture.views, wrong_type=[None, 3, "r_0", ("r_0",), lambda b: b.view]),
    "opened capture": kind(lambda b: b.capture, wrong_type=[None, 3, [], b"x", lambda b: b.view], empty=["", "\0"], missing=TYPO),
    "edit": kind(lambda b: b.model.edit(), wrong_type=[None, 3, "edit.json", {}, lambda b: b.folder / "edit.json", lambda b: b.model.palettes],
                 NaN=[_edit_with(NAN)], empty=[lambda b: karf.Edit({})], missing=[_edit_with(0.5, "typo")],
                 wrong_shape=[lambda b: karf.Edit({name: np.zeros((2 + len(c), 3)) for name, c in b.model.edit().colors.items()})]),
    "any edit": kind(lambda b: b.model.edit(), wrong_type=[None, 3, "edit.json", {}, lambda b: b.model.palettes], NaN=[_edit_with(NAN)]),
    "edits": kind(lambda b: [b.model.edit()], wrong_type=[None, 3, "edit.json", ["edit.json"], lambda b: b.model.edit()],
                  NaN=[lambda b: [_edit_with(NAN)(b)]], missing=[lambda b: [_edit_with(0.5, "typo")(b)]]),
    "frame": kind(lambda b: b.frame, wrong_type=[None, 3, lambda b: b.frame.base, lambda b: b.view],
                  wrong_shape=[lambda b: replace(b.frame, probabilities=b.frame.probabilities[:1], palette_weights=b.frame.palette_weights[:1])]),
    "frame with weights": kind(lambda b: b.frame, wrong_type=[None, 3, lambda b: b.frame.base, lambda b: b.view],
                  wrong_shape=[lambda b: replace(b.frame, probabilities=b.frame.probabilities[:1], palette_weights=b.frame.palette_weights[:1])],
                  empty=[lambda b: replace(b.frame, palette_weights=None)]),
    "any rendered": kind(lambda b: b.frame.picture, wrong_type=[None, 3, lambda b: b.frame, lambda b: b.frame.base]),
    "stored photo": kind(lambda b: b.photo_view.photo, wrong_type=[None, 3, lambda b: b.view, lambda b: b.frame]),
    "palettes": kind(lambda b: b.model.palettes, wrong_type=[None, 3, "ball", ["ball"], lambda b: b.model.palettes[0]]),
    "own project": kind(lambda b: b.model.project, wrong_type=[None, 3, "project", lambda b: b.project]),
    "torch device": kind("cpu", wrong_type=[None, 3, object()], empty=[""], wrong_device=["typo", "cuda:99", "meta"]),
    "settings": kind(lambda b: b.model.settings, wrong_type=[3, "demo", {}]),
    "group": kind(None, wrong_type=[None, 3, "demo", {}]),
    "sparse points": kind(None, wrong_type=[3, "points", np.zeros((2, 3))]),
    "captured splats": kind(None, wrong_type=[3, "splats.ply"]),
    "mattes": kind(lambda b: b.photo_view.mattes, wrong_type=[None, 3, "m", ["m"]]),
    "objects": kind(lambda b: b.model.objects, wrong_type=[None, 3, "ball", [3]]),
    "orientation": kind(1, wrong_type=[None, "1", 1.5], empty=[0], huge=[9]),
    "values": kind({}, answered=(ANY_TYPE,)),
    # networks
    "inputs": tensors(4, 3),
    "encodings": tensors(4, 9),
    "directions": kind(None, wrong_type=[3, "d", np.zeros((4, 3))], wrong_shape=[torch.zeros(4, 5)]),
    "features": tensors(4, 2),
    "vectors": kind(torch.zeros(4, 3), ("NaN", "empty"), wrong_type=[None, [[0.0]], np.zeros((4, 3)), torch.zeros(4, 3, dtype=torch.int64)],
                    wrong_shape=[torch.tensor(0.0)], NaN=[torch.full((4, 3), NAN)], empty=[torch.zeros(0, 3)]),
    "some directions": kind(None, wrong_type=[3, "d", np.zeros((4, 3))], wrong_shape=[torch.zeros(5, 3)], wrong_device=[torch.zeros(4, 3, device="meta")]),
    "measured": kind(torch.rand(4, 2), wrong_type=[None, [[0.0]], np.zeros((4, 2))], wrong_shape=[torch.zeros(4, 3), torch.tensor(0.0)],
                     NaN=[torch.full((4, 2), NAN)], empty=[torch.zeros(0, 2)]),
    "weight": kind(torch.zeros(2, 18), wrong_type=[None, [[0.0]], np.zeros((2, 18))], wrong_shape=[torch.zeros(2, 17), torch.zeros(18)],
                   wrong_device=[torch.zeros(2, 18, device="meta")]),
    "bias": kind(torch.zeros(2), wrong_type=[None, [0.0], np.zeros(2)], wrong_shape=[torch.zeros(3)]),
    "bandwidth tensor": kind(torch.tensor(1.0), wrong_type=[None, 1.0, "eq5"], wrong_shape=[torch.zeros(3)]),
    "layer": kind("grbf", wrong_type=[None, 3], empty=[""], missing=["typo"]),
    "variant": kind("all", wrong_type=[None, 3], empty=[""], missing=["typo"]),
    "module": kind(torch.nn.Linear(3, 2), wrong_type=[None, 3, torch.zeros(3)]),
    "new layer": kind("mine", wrong_type=[None, 3], empty=[""], taken=["grbf"]),
    "builder": kind(lambda b: torch.nn.Linear, wrong_type=[None, 3, "grbf"]),
    "options": kind(None, wrong_type=[object()], NaN=[NAN]),  # each of a command's keywords; which types: io.options
}  # fmt: skip


def row(**kinds: str) -> dict[str, str]:
    """A callable's arguments by name, each with its kind."""
    return kinds


ROWS: dict[str, dict[str, str]] = {
    "find_poses": row(photos="photos", out="new folder"),
    "import_splat": row(splat="splat", out="new folder"),
    "inspect_capture": row(capture="opened capture"),
    "mark": row(capture="opened capture", view="view name", object_name="new mask", masks="new masks"),
    "learn": row(capture="opened capture", masks="masks", project="new folder"),
    "learn_geometry": row(capture="opened capture", project="new folder"),
    "segment": row(project="project", masks="own masks"),
    "extract_palettes": row(project="project"),
    "learn_recoloring": row(project="project"),
    "learn_splats": row(project="project"),
    "load": row(project="project", device="device"),
    "render": row(project="project", out="new folder"),
    "colorways": row(project="project", sheet="sheet", out="new folder"),
    "write_points": row(project="project", out="new points"),
    "export_splat": row(project="project", out="new points"),
    "render_bundle": row(project="project", out="new folder"),
    "learning_bundle": row(capture="opened capture", masks="masks", out="new folder"),
    "open_capture": row(path="capture", photos="flag", holdout="holdout"),
    "Camera": row(width="length", height="length", fx="focal length", fy="focal length", cx="coordinate", cy="coordinate",
                  camera_to_world="pose", distortion="distortion", fisheye="flag"),
    "Camera.without_distortion": row(),
    "Camera.scaled": row(width="length", height="length"),
    "Camera.reduced": row(long_side="length"),
    "Camera.project": row(points="points"),
    "Camera.rays": row(pixels="pixels"),
    "Camera.pixel_centers": row(),
    "orbit": row(cameras="cameras", count="length", elevation="elevation"),
    "camera_spline": row(cameras="cameras", count="width", is_closed="flag"),
    "write_video": row(path="new video", frames="frames", fps="fps"),
    "Capture": row(source="path", format="text", views="views", warnings="texts", points="sparse points", holdout="holdout",
                   splats="captured splats"),
    "Capture.split": row(name="split"),
    "Capture.view": row(name="view name"),
    "View": row(name="name", stem="name", camera="camera", image="image", split="split", depth_bounds="bounds"),
    "KarfError": row(sentence="text", hint="text", values="values"),
    "read_edit": row(path="edit file", palettes="palettes", compositing="compositing"),
    "write_edit": row(path="new edit file", edit="any edit"),
    "read_color_book": row(path="book file"),
    "nearest_names": row(book="book", color="rgb", count="length"),
    "ColorBook": row(name="text", names="three names", lab="palette"),
    "ColorBook.lab_of": row(name="color name"),
    "Edit": row(colors="colors", compositing="compositing", added="added", edges="edges"),
    "Palette": row(name="name", colors="palette"),
    "Settings": row(preset="text", seed="seed", compositing="compositing", geometry="group", segmentation="group",
                    palette="group", recoloring="group", splats="group", render="group"),
    "Frame": row(picture="any rendered", probabilities="probabilities", palette_weights="weights", base="base picture", disputed="texts"),
    "Model": row(project="own project", device="torch device", settings="settings"),
    "Model.load": row(folder="project", device="device"),
    "Model.render": row(camera="camera", supersampling="rays a pixel"),
    "Model.render_recolored": row(camera="camera", edit="edit"),
    "Model.recolored_splats": row(edit="edit"),
    "Model.render_background": row(camera="camera"),
    "Model.render_view": row(view="view", base="base"),
    "Model.working_camera": row(view="view"),
    "Model.render_field": row(camera="camera"),
    "Model.label_uncertainty": row(pinhole="camera", frame="frame"),
    "Model.preview": row(view="view", long_side="maybe length"),
    "Model.photo_view": row(view="view", size="size"),
    "Model.training_image": row(view="view"),
    "Model.edit": row(path="edit file or none"),
    "Model.match": row(view="view", picture="picture", edit="edit"),
    "Model.recolor": row(view="view", edit="edit", size="size"),
    "Model.with_edges": row(frame="frame with weights", edges="edges"),
    "Model.composite": row(frame="frame with weights", edit="edit"),
    "ProjectEdit": row(colors="colors", compositing="compositing", added="added", edges="edges", project="own project",
                       palettes="palettes"),
    "ProjectEdit.becomes": row(name="object", source="color", target="color", rule="rule", also="pairs", is_metal="flag"),
    "ProjectEdit.add_color": row(name="object", picked="color", wanted="color", reach="reach", protect="protect"),
    "ProjectEdit.swatch": row(name="object", index="swatch", color="color"),
    "ProjectEdit.edge": row(name="object", choke="choke", feather="feather"),
    "ProjectEdit.surface": row(name="object", index="swatch", saturation="factor", brightness="stops", gloss="factor"),
    "ProjectEdit.save": row(path="new edit file"),
    "PhotoView": row(photo="stored photo", orientation="orientation", objects="objects", mattes="mattes", palettes="palettes",
                     scale="scale", grain="grain"),
    "PhotoView.recolor": row(edit="edit"),
    "PhotoView.recolor_all": row(edits="edits"),
    "PhotoView.masks": row(),
    "PhotoView.over_white": row(photo="stored photo"),
    "PhotoView.layers": row(depth="depth", added="maybe added", edges="maybe edges"),
    "kan.BSplineLayer": row(n_in="width", n_out="width", grid="width", order="octaves", layer_norm="flag"),
    "kan.BSplineLayer.forward": row(x="inputs"),
    "kan.GRBFLayer": row(n_in="width", n_out="width", n_centers="centers", bandwidth="bandwidth", learn_bandwidth="flag"),
    "kan.GRBFLayer.bandwidth": row(),
    "kan.GRBFLayer.forward": row(x="inputs"),
    "kan.GatedBlock": row(n_position="width", n_direction="width or 0", n_features="width or 0", n_out="width", width="width",
                          layer="layer", variant="variant", n_centers="centers", bandwidth="bandwidth", learn_bandwidth="flag"),
    "kan.GatedBlock.forward": row(position_encoding="encodings", features="features", direction_encoding="directions"),
    "kan.LayerOptions": row(n_centers="centers", bandwidth="bandwidth", learn_bandwidth="flag", is_output="flag"),
    "kan.MLPHead": row(n_position="width", n_direction="width or 0", n_features="width or 0", n_out="width", width="width"),
    "kan.MLPHead.forward": row(position_encoding="encodings", features="features", direction_encoding="directions"),
    "kan.MLPLayer": row(n_in="width", n_out="width", is_output="flag"),
    "kan.MLPLayer.forward": row(x="inputs"),
    "kan.Standardizer": row(n_features="width or 0"),
    "kan.Standardizer.fit": row(features="measured"),
    "kan.Standardizer.forward": row(features="features"),
    "kan.bspline_bases": row(u="vectors", grid="width", order="octaves"),
    "kan.count_parameters": row(module="module"),
    "kan.grbf_reference": row(x="inputs", u="inputs", weight="weight", bias="bias", bandwidth="bandwidth tensor", n_centers="centers"),
    "kan.grid_spacing": row(n_centers="centers"),
    "kan.join_inputs": row(position_encoding="vectors", features="vectors", direction_encoding="some directions"),
    "kan.positional_encoding": row(x="vectors", n_frequencies="octaves"),
    "kan.register_layer": row(name="new layer", build="builder"),
    "kan.resolve_bandwidth": row(bandwidth="bandwidth", n_centers="centers"),
}  # fmt: skip

SUBJECTS: dict[str, Make] = {  # whose methods are called
    "Camera": lambda bench: bench.camera,
    "Capture": lambda bench: bench.capture,
    "ColorBook": lambda bench: karf.read_color_book(bench.folder / "book.csv"),
    "Model": lambda bench: bench.model,
    "ProjectEdit": lambda bench: bench.model.edit(),
    "PhotoView": lambda bench: bench.photo_view,
    "kan.BSplineLayer": lambda bench: kan.BSplineLayer(3, 2),
    "kan.GRBFLayer": lambda bench: kan.GRBFLayer(3, 2),
    "kan.GatedBlock": lambda bench: kan.GatedBlock(9, 0, 2, 2, width=4),
    "kan.MLPHead": lambda bench: kan.MLPHead(9, 0, 2, 2, width=4),
    "kan.MLPLayer": lambda bench: kan.MLPLayer(3, 2),
    "kan.Standardizer": lambda bench: kan.Standardizer(2),
}


def public_names() -> Iterator[str]:
    """Every public name that can be called: functions, classes, and the classes' public methods."""
    owners = {"": (karf, karf.__all__), "kan.": (kan, kan.__all__)}
    things = {f"{prefix}{name}": getattr(owner, name) for prefix, (owner, names) in owners.items() for name in names}
    for name, thing in (things | CLASSES).items():
        if name not in VALUES:
            yield name
        if inspect.isclass(thing):
            yield from (
                f"{name}.{each}" for each in vars(thing) if not each.startswith("_") and _is_method(thing, each)
            )


def _is_method(thing: type, name: str) -> bool:
    return callable(getattr(thing, name)) and not isinstance(inspect.getattr_static(thing, name), type)


def callable_of(name: str, bench: Bench) -> Callable[..., Any]:
    """What a name calls, bound to a subject where it is a method."""
    *owner, last = name.removeprefix("kan.").rsplit(".", 1)
    prefix = "kan." if name.startswith("kan.") else ""
    if owner:
        return getattr(SUBJECTS[prefix + owner[0]](bench), last)
    return CLASSES[last] if last in CLASSES else getattr(kan if prefix else karf, last)


def parameters(function: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """Parameters of a callable by name."""
    return dict(inspect.signature(function).parameters)


def arguments(name: str, bench: Bench) -> dict[str, Any]:
    """Right arguments of a callable; what has a default of its own kind may be left out."""
    found = {each: KINDS[which].right(bench) for each, which in ROWS[name].items() if which not in ("group", "values")}
    return found


@dataclass(frozen=True)
class Misuse:
    """One wrong call: what is wrong with it, of which arguments, and what makes the call."""

    what: str
    names: tuple[str, ...]
    call: Callable[[Bench], Any]
    may_answer: bool = False


def misuses(name: str, bench: Bench) -> Iterator[Misuse]:
    """Every misuse of a callable."""
    function = callable_of(name, bench)
    known = parameters(function)
    kinds = ROWS[name] | {each: "options" for each in known if each not in ROWS[name]}
    for argument, which in kinds.items():
        for what, makers in KINDS[which].wrong.items():
            for make in makers:
                change = lambda bench, right, argument=argument, make=make: right | {argument: make(bench)}  # noqa: E731
                may_answer = what in KINDS[which].answered
                call = _calling(name, known, change)
                yield Misuse(what, (argument,), _saying_nan(call) if may_answer and what == "NaN" else call, may_answer)
    for one, other in _neighbors(ROWS[name]):
        swap = lambda bench, right, one=one, other=other: right | {one: right[other], other: right[one]}  # noqa: E731
        yield Misuse("swapped", (one, other), _calling(name, known, swap))
    if not any(each.kind is each.VAR_KEYWORD for each in known.values()):
        yield Misuse(
            "unknown keyword", ("unknown",), _calling(name, known, lambda bench, right: right | {"unknown": 1})
        )


def _neighbors(kinds: Mapping[str, str]) -> list[tuple[str, str]]:
    """Arguments side by side that can be told apart."""
    pairs = zip(kinds, list(kinds)[1:], strict=False)
    alike = {frozenset(("length", "maybe length")), frozenset(("width", "octaves")), frozenset(("width", "width or 0")),
             frozenset(("focal length", "coordinate")), frozenset(("view name", "new mask")), frozenset(("width", "centers")),
             frozenset(("text", "values")), frozenset(("bandwidth tensor", "bias")), frozenset(("path", "text")),
             frozenset(("reach", "protect")), frozenset(("scale", "grain")),
             frozenset(("factor", "stops"))}  # fmt: skip
    return [(a, b) for a, b in pairs if kinds[a] != kinds[b] and frozenset((kinds[a], kinds[b])) not in alike
            and "group" not in (kinds[a], kinds[b])]  # fmt: skip


def _calling(
    name: str, known: Mapping[str, inspect.Parameter], change: Callable[[Bench, dict], dict]
) -> Callable[[Bench], Any]:
    def call(bench: Bench) -> Any:
        return called(callable_of(name, bench), known, change(bench, arguments(name, bench)))

    return call


def _saying_nan(call: Callable[[Bench], Any]) -> Callable[[Bench], Any]:
    """A call whose answer must hold not-a-number itself."""

    def calling(bench: Bench) -> Any:
        result = call(bench)
        frame = (
            [result.base, result.probabilities, result.palette_weights] if isinstance(result, karf.Frame) else result
        )
        parts = frame if isinstance(frame, list | tuple) else [frame]
        arrays = [np.asarray(part.detach() if isinstance(part, torch.Tensor) else part) for part in parts]
        assert any(np.isnan(array).any() for array in arrays), "a finite answer"
        return result

    return calling


def called(function: Callable[..., Any], known: Mapping[str, inspect.Parameter], given: dict[str, Any]) -> Any:
    """What a call gives; what it yields is asked for."""
    places = [given.pop(each) for each, item in known.items() if item.kind is item.POSITIONAL_ONLY and each in given]
    result = function(*places, **given)
    return list(result) if inspect.isgenerator(result) else result
