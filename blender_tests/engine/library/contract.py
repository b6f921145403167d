"""Valid and invalid values for every argument of the library's public functions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

import karf_engine as karf
from karf_engine.palettes.edge_shape import EdgeShape

NAN, INF = float("nan"), float("inf")
OMITTED = object()  # the argument is left to its default


class Kind:
    """A kind of argument: a valid value, invalid ones, and values that may be accepted.

    Where an accepted value holds NaN, so must the answer.
    """

    def __init__(self, valid: Any, *invalid: Any, accepted: tuple = ()) -> None:
        self.valid, self.invalid, self.accepted = valid, invalid, accepted


def path(valid: Path, *invalid: Any) -> Kind:
    return Kind(valid, 3, [], b"x", object(), "", "\0", *invalid)


def whole(valid: int, *invalid: Any) -> Kind:
    return Kind(valid, "8", 1.5, [8], True, NAN, *invalid)


def number(valid: float, *invalid: Any) -> Kind:
    return Kind(valid, "1", [1], NAN, INF, *invalid)


def text(valid: str, *invalid: Any) -> Kind:
    return Kind(valid, None, 3, [valid], *invalid)


def array(valid: np.ndarray, *invalid: Any, accepted: tuple = ()) -> Kind:
    return Kind(valid, "a", 3, valid.tolist(), np.full(valid.shape, "a"), *invalid, accepted=accepted)


def rows(n_columns: int) -> Kind:
    """An array of points, one in each row; no rows and NaN may be accepted."""
    invalid = (np.zeros(n_columns), np.zeros((2, 5 - n_columns)), np.zeros((2, 2, n_columns)))
    accepted = (np.full((2, n_columns), NAN), np.zeros((0, n_columns)))
    return array(np.zeros((2, n_columns)) - 1, None, *invalid, accepted=accepted)


def tensor(*shape: int, invalid: tuple = ()) -> Kind:
    """A layer's input; no rows and NaN may be accepted."""
    types = ([[0.0] * shape[-1]], np.zeros(shape, np.float32), torch.zeros(shape, dtype=torch.int64))
    accepted = (torch.full(shape, NAN), torch.zeros(0, shape[-1]))
    return Kind(torch.zeros(*shape), None, *types, torch.tensor(0.0), *invalid, accepted=accepted)


def layer_input(*shape: int) -> Kind:
    """An input of a layer with fixed width and device."""
    other = torch.zeros(*shape[:-1], shape[-1] + 1)
    invalid = (torch.zeros(shape, dtype=torch.float64), other, torch.zeros(shape, device="meta"))
    return tensor(*shape, invalid=invalid)


def kinds(folder: Path, model: karf.Model) -> dict[str, Kind]:
    """Kinds by argument; `function.argument` takes precedence where arguments of one name differ.

    The folder holds a capture, its masks, its learned project (the model), edit.json, sheet.csv and book.csv.
    """
    typo, view = folder / "typo", model.capture.split("train")[0]
    camera = view.camera.reduced(8)
    frame, photo_view = model.render(camera), model.photo_view(view)
    size = (view.camera.height, view.camera.width)
    one_object = {"probabilities": frame.probabilities[:1], "palette_weights": frame.palette_weights[:1]}
    edit, book = model.edit(), karf.read_color_book(folder / "book.csv")
    of_typo = karf.Edit(edit.colors | {"typo": edit.colors["ball"]})
    of_more_colors = karf.Edit({name: np.zeros((2 + len(colors), 3)) for name, colors in edit.colors.items()})
    bad_colors = ([], {"ball": [[0, 0, 0]]}, {3: np.zeros((2, 3))}, {"ball": np.zeros(3)}, {"ball": np.zeros((2, 4))})
    odd_colors = [{"ball": values} for values in (np.full((2, 3), NAN), np.zeros((0, 3)), np.full((2, 3), 9.0))]
    edges, bad_edges = {"ball": EdgeShape(1.0)}, (3, [], {"ball": (1.0, 2.0)}, {3: EdgeShape()})
    added = (3, [], {"ball": ["#ffffff"]}, {3: ()})
    table = {
        # paths
        "open_capture.path find_poses.photos convert_panoramas.capture": path(folder / "capture", None, typo),
        "masks": path(folder / "masks", None, typo),
        "segment.masks": path(folder / "masks", typo),
        "project folder": path(model.project.folder, None, typo, folder / "capture", folder / "edit.json"),
        "out learn.project learn_geometry.project": path(folder / "new", None),
        "mark.masks": path(folder / "new masks", None),
        "write_points.out export_splat.out": path(folder / "new.ply", None, folder / "new.yaml"),
        "splat": path(folder / "edit.json", None, typo),
        "sheet": path(folder / "sheet.csv", None, typo),
        "read_edit.path": path(folder / "edit.json", None, typo),
        "Model.edit.path": path(folder / "edit.json", typo),
        "write_edit.path ProjectEdit.save.path": path(folder / "new.json", None, folder / "new.yaml"),
        "read_color_book.path": path(folder / "book.csv", None, typo, folder / "edit.json"),
        "write_video.path": path(folder / "new.mp4", None, folder / "new.yaml"),
        "Model.match.picture": path(view.image, None, typo),
        "Capture.source": Kind(folder / "capture", None, 3, [], b"x", object()),
        "image": Kind(None, 3, [], b"x", object()),
        # texts
        "sentence hint format preset ColorBook.name": text("text"),
        "View.name stem Palette.name": text("r_0", ""),
        "mark.view Capture.view.name": text(view.name, "", "typo"),
        "object_name": text("pot", "", "../pot", "a/b", b"x"),
        "name": text("ball", "", "typo"),
        "lab_of.name": text("Red", "", "typo"),
        "faces": text("front,up", "", "typo"),
        "split Capture.split.name": text("train", "", "typo"),
        "rule": text("becomes", "", "typo"),
        "compositing": text("delta", "", "typo"),
        "layer": text("grbf", "", "typo"),
        "variant": text("all", "", "typo"),
        "register_layer.name": text("mine", "", "grbf"),
        "render_view.base": Kind("photo", 3, object(), "", "typo"),
        "device": Kind("cpu", 3, object(), "", "typo", "cuda:99", "meta"),
        "Model.device": Kind("cpu", None, 3, object(), "", "typo", "cuda:99", "meta"),
        "warnings disputed": Kind((), "text", None, [3], (3,)),
        "names": Kind(("a", "b", "c"), "abc", None, 3, (3, 4, 5), (), ("a", "b")),
        # numbers
        "fisheye is_closed is_metal layer_norm learn_bandwidth is_output open_capture.photos": Kind(
            True, "yes", 1.5, None, []
        ),
        "width height count Camera.reduced.long_side n_in n_out grid n_position": whole(8, None, 0, -1),
        "preview.long_side": whole(8, 0, -1),
        "n_direction n_features": whole(3, None, -1),
        "order n_frequencies": whole(2, None, -1),
        "n_centers": whole(5, None, 0, 1, -1),
        "holdout": whole(0, None, -1, 1),
        "seed": whole(0, None, -1),
        "supersampling": whole(1, None, 0, -1, 10**6),
        "index": whole(1, None, 0, -1, 99),
        "orientation": whole(1, None, 0, 9),
        "convert_panoramas.size": whole(16, 0, -1),
        "size": Kind("photo", None, 1.5, [8], object(), NAN, 0, "", -1, "typo"),
        "fx fy": number(9.0, None, 0.0, -1.0),
        "cx cy": number(4.0, None),
        "protect": number(0.2, None, 1.0, -1.0),
        "reach": number(0.5, None, 0.0, -1.0),
        "saturation gloss": number(0.5, None, -1.0, 99.0),
        "brightness": number(0.5, None, 99.0, -99.0),
        "choke": number(-1.5, None, 16.5, -17.0),
        "feather": number(4, None, -1.0, 65.0),
        "grain": number(0.5, None, -1.0),
        "scale": number(0.5, None, 0.0, -1.0),
        "elevation": number(20.0, 90.0, -99.0),
        "fps": number(24.0, None, 0.0, -1.0),
        "bandwidth": Kind("eq5", None, [1], NAN, INF, "", 0.0, "typo", -1.0),
        "distortion": Kind((), "k", None, 3, ("k",), (NAN,)),
        "depth_bounds": Kind((1.0, 2.0), 3, "12", (1.0,), ("1", "2"), (NAN, 1.0), (2.0, 1.0)),
        # arrays
        "camera_to_world": array(
            np.eye(4), None, np.eye(3), np.zeros(16), np.zeros((0, 4)), np.full((4, 4), NAN),
            np.diag([NAN, 1, 1, 1]), np.diag([-1.0, 1, 1, 1]),
        ),
        "points": rows(3),
        "pixels": rows(2),
        "lab Palette.colors": array(
            np.zeros((3, 3)), None, np.zeros(3), np.zeros((3, 2)), np.full((3, 3), NAN), np.zeros((0, 3))
        ),
        "nearest_names.color": array(
            np.zeros(3), None, "#ffffff", np.zeros(2), np.zeros((2, 3)), np.full(3, NAN), np.zeros(0)
        ),
        "Frame.base": array(
            frame.base, None, np.zeros((2, 2)), np.zeros((3, 5, 3)), np.zeros((0, 0, 3)), accepted=(frame.base * NAN,)
        ),
        "probabilities": array(
            frame.probabilities, None, np.zeros((2, 2)), np.zeros((2, 3, 5)), np.zeros((0, 0, 0)),
            accepted=(frame.probabilities * NAN,),
        ),
        "palette_weights": array(
            frame.palette_weights, np.zeros((2, 2)), np.zeros((2, 3, 3, 5)), np.zeros((0, 0, 0, 0)),
            accepted=(frame.palette_weights * NAN,),
        ),
        "depth": array(np.ones(size, np.float32), None, np.ones(3), np.ones((0, 0))),
        # colors
        "color source target picked wanted": Kind(
            "#2060a0", None, 3, {}, object(), (0.1, 0.2), np.zeros((3, 3)), (NAN, 0.0, 0.0), "", (), "blue",
            (9.0, 0.0, 0.0),
        ),
        "boxes": Kind([np.eye(4).ravel().tolist()], None, 3, "ab", [3], [(1.0,)], [[NAN] * 16], [[0.0] * 16]),
        "also": Kind((), None, 3, "ab", [("#ffffff",)], ["#ffffff"], [(1, 2)], [("#ffffff", (NAN, 0, 0))]),
        "colors": Kind(edit.colors, None, 3, *bad_colors, *odd_colors),
        "added": Kind({}, None, *added),
        "layers.added": Kind(None, *added),
        "edges": Kind(edges, None, *bad_edges),
        "layers.edges": Kind(edges, *bad_edges),
        # objects of the library
        "camera pinhole": Kind(
            camera, None, 3, "r_0", view, camera.camera_to_world, replace(camera, width=10**9),
            replace(camera, camera_to_world=camera.camera_to_world * [[2, 2, 2, 1]]),
        ),
        "cameras": Kind([each.camera for each in model.capture.views], None, 3, "r_0", ["r_0"], camera, []),
        "view": Kind(view, None, 3, "r_0", camera, model.capture),
        "views": Kind(model.capture.views, None, 3, "r_0", ("r_0",), view),
        "capture": Kind(model.capture, None, 3, [], b"x", view, "", "\0", typo),
        "frames": Kind([frame.base], None, 3, "f", ["f"], [None], [np.zeros((2, 2))], []),
        "edit": Kind(
            edit, None, 3, "edit.json", {}, folder / "edit.json", model.palettes, karf.Edit({}), of_typo, of_more_colors
        ),
        "write_edit.edit": Kind(edit, None, 3, "edit.json", {}, model.palettes),
        "edits": Kind([edit], None, 3, "edit.json", ["edit.json"], edit, [of_typo]),
        "frame": Kind(
            frame, None, 3, frame.base, view, replace(frame, **one_object), replace(frame, palette_weights=None)
        ),
        "label_uncertainty.frame": Kind(frame, None, 3, frame.base, view, replace(frame, **one_object)),
        "picture": Kind(frame.picture, None, 3, frame, frame.base),
        "photo": Kind(photo_view.photo, None, 3, view, frame),
        "mattes": Kind(photo_view.mattes, None, 3, "m", ["m"]),
        "palettes ProjectEdit.palettes": Kind(model.palettes, None, 3, "ball", ["ball"], model.palettes[0]),
        "objects": Kind(model.objects, None, 3, "ball", [3]),
        "Model.project ProjectEdit.project": Kind(model.project, None, 3, "project", model.project.folder),
        "book": Kind(book, None, 3, "book.csv", {}),
        "settings": Kind(model.settings, 3, "demo", {}),
        "Capture.points": Kind(None, 3, "points", np.zeros((2, 3))),
        "Capture.splats": Kind(None, 3, "splats.ply"),
        # networks
        "x grbf_reference.u": layer_input(4, 3),
        "position_encoding": layer_input(4, 9),
        "features": layer_input(4, 2),
        "direction_encoding": Kind(None, 3, "d", np.zeros((4, 3)), torch.zeros(4, 5)),
        "positional_encoding.x u join_inputs.position_encoding join_inputs.features": tensor(4, 3),
        "join_inputs.direction_encoding": Kind(
            None, 3, "d", np.zeros((4, 3)), torch.zeros(5, 3), torch.zeros(4, 3, device="meta")
        ),
        "fit.features": Kind(
            torch.rand(4, 2), None, [[0.0]], np.zeros((4, 2)), torch.zeros(4, 3), torch.tensor(0.0),
            torch.full((4, 2), NAN), torch.zeros(0, 2),
        ),
        "weight": Kind(
            torch.zeros(2, 18), None, [[0.0]], np.zeros((2, 18)), torch.zeros(2, 17), torch.zeros(18),
            torch.zeros(2, 18, device="meta"),
        ),
        "bias": Kind(torch.zeros(2), None, [0.0], np.zeros(2), torch.zeros(3)),
        "grbf_reference.bandwidth": Kind(torch.tensor(1.0), None, 1.0, "eq5", torch.zeros(3)),
        "module": Kind(torch.nn.Linear(3, 2), None, 3, torch.zeros(3)),
        "build": Kind(torch.nn.Linear, None, 3, "grbf"),
        # left to their defaults
        "geometry segmentation palette recoloring Settings.splats render": Kind(OMITTED, None, 3, "demo", {}),
        "values": Kind(OMITTED),
        "options": Kind(OMITTED, object(), NAN),  # each keyword of a command, whose types io.options checks
    }  # fmt: skip
    return {name: known for names, known in table.items() for name in names.split()}
