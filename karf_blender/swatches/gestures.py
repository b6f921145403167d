"""Swatches that follow a changed one: linked and merged ones, sets of added colors and, with Material, its paint.

The object stores its last drag (`dragged`, `began`): keyframes move a paint after the file is opened again.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from .. import progress, session
from ..engine_api import KarfError
from ..host import rendering
from . import colors, displayed, keyframes, solving
from .solving import Gesture, States

Key = tuple[int, str]  # of an object: its scene's `session_uid` and its name


@dataclass
class _Memory:
    per_file = True

    gestures: dict[Key, Gesture] = field(default_factory=dict)
    last_colors: dict[Key, np.ndarray] = field(default_factory=dict)  # chosen ones as of the last change or event
    is_suspended: bool = False


@contextmanager
def suspended(scene: bpy.types.Scene) -> Iterator[None]:
    """Set swatches of a scene inside this block without any other following."""
    state = session.get(_Memory)
    before, state.is_suspended = state.is_suspended, True
    try:
        yield
    finally:
        state.is_suspended = before
        _remember_colors(scene)


# --- changes -------------------------------------------------------------------------------------------------------
def color_changed(swatch: bpy.types.PropertyGroup) -> None:
    """Update the swatches that move with a changed one, and the picture. Colors set by programs move no paint.

    A locked swatch gets its color back: its field is not disabled, since Blender would draw the color too dark.
    """
    if session.get(_Memory).is_suspended:
        return
    scene, (item, index) = swatch.id_data, colors.place_of(swatch)
    now = colors.states(scene)
    before, own = session.get(_Memory).last_colors.get(_key(item)), now[item.name]
    before = own.learned if before is None or len(before) != len(own.chosen) else before
    if swatch.locked and (own.chosen[index] != before[index]).any():
        with suspended(scene):
            swatch.color = before[index]
        progress.warn("Swatch {index} of {name!r} is locked.", index=index, name=item.name)
        return
    start_colors = own.chosen.copy()
    start_colors[index] = before[index]
    start = now | {item.name: own.with_colors(start_colors)}
    moved = solve_sets(scene, solving.assign(start, item.name, index, swatch.color), item.name, index)
    if scene.karf.material and not displayed.is_batched():
        moved = _move_paints(scene, start, moved, solving.linked(start, item.name, index))
    write(scene, moved)
    displayed.of(scene).refresh()


def surface_changed(swatch: bpy.types.PropertyGroup) -> None:
    """Give the swatches linked to a changed one its surface, and update the picture."""
    if session.get(_Memory).is_suspended:
        return
    item, index = colors.place_of(swatch)
    share_surface(item, index)
    displayed.of(swatch.id_data).refresh()


def share_surface(item: bpy.types.PropertyGroup, index: int) -> None:
    """Give the unlocked swatches linked to one its surface."""
    states = colors.states(item.id_data)
    surface = states[item.name].surface_of(index)
    with suspended(item.id_data):
        for name, own in solving.linked(states, item.name, index).items():
            for number in np.flatnonzero(own & ~states[name].locked):
                colors.write_surface(item.id_data.karf.objects[name].swatches[number], surface)


def reset(item: bpy.types.PropertyGroup, index: int, follows: bool) -> Mapping[str, np.ndarray]:
    """Reset a swatch's color, those that move with it and, if it `follows`, its paint; return the former, [M] bool."""
    scene = item.id_data
    start = colors.states(scene)
    moved, masks = solving.reset(start, item.name, index)
    if follows and scene.karf.material and _is_dragged(item, index, start):
        moved = _move_paints(scene, start, moved, solving.linked(start, item.name, index))
    write(scene, moved)
    return masks


def drag_again(item: bpy.types.PropertyGroup) -> None:
    """Solve an object's last drag anew where nothing has changed since but Metal."""
    scene, gesture = item.id_data, _last_drag(item)
    if gesture is not None and scene.karf.material:
        now = colors.states(scene)
        if gesture.continues(gesture.moved, now[item.name].chosen):
            write(scene, _move_paints(scene, now, now, {item.name: _mask(now[item.name], gesture.moved)}))
            displayed.of(scene).refresh()


# --- solving -------------------------------------------------------------------------------------------------------
def solve_sets(scene: bpy.types.Scene, states: States, name: str, index: int) -> States:
    """Return the states with the sets of a swatch and those linked to it; warn of those that cannot be solved."""
    result = dict(states)
    for each, own in solving.linked(states, name, index).items():
        for number in np.flatnonzero(own & states[each].is_added):
            try:
                result[each] = solving.solve_set(result[each], number, displayed.of(scene).learned_histogram(each))
            except (KarfError, OSError) as error:
                progress.warn(str(error))
    return result


def _move_paints(
    scene: bpy.types.Scene, start: States, moved: States, own: Mapping[str, np.ndarray], begins: bool = True
) -> States:
    """Return `moved` with the paints of dragged swatches `own`, [M] bool; unless `begins`, of continued drags only."""
    result, known = dict(moved), session.get(_Memory).gestures
    for name, mask in own.items():
        state, key = moved[name], (scene.session_uid, name)
        locked_links = state.locked & (state.link > 0) & (mask.sum() > 1)
        paints = tuple(np.flatnonzero(mask & (state.merged == 0) & ~state.is_added & ~locked_links).tolist())
        gesture = known.get(key)
        continues = gesture is not None and gesture.continues(paints, start[name].chosen)
        if not paints or not (begins or continues):
            continue
        if not continues:
            gesture = Gesture(paints, start[name].chosen, start[name].chosen)
            item = scene.karf.objects[name]
            item.dragged = paints[0] if len(paints) == 1 else 0
            item.swatches.foreach_set("began", gesture.start.ravel())
        try:
            histogram = displayed.of(scene).histogram(state)
        except (KarfError, OSError):  # nobody has counted the object's colors: the swatches move alone
            continue
        result[name] = solving.drag(state, gesture, histogram)
        known[key] = replace(gesture, result=result[name].chosen)
    return result


def write(scene: bpy.types.Scene, states: States) -> None:
    """Give a scene's swatches the colors of these states; nothing follows them."""
    with suspended(scene):
        for item in scene.karf.objects:
            colors.write(item, states[item.name].chosen)


def _remember_colors(scene: bpy.types.Scene) -> None:
    """Remember the current colors: the next change of a swatch begins there."""
    for item in scene.karf.objects:
        session.get(_Memory).last_colors[_key(item)] = colors.chosen(item)


def _key(item: bpy.types.PropertyGroup) -> Key:
    return item.id_data.session_uid, item.name


def _mask(state: solving.PaletteState, numbers) -> np.ndarray:
    return np.isin(np.arange(len(state.chosen)), numbers)


def _last_drag(item: bpy.types.PropertyGroup) -> Gesture | None:
    return session.get(_Memory).gestures.get(_key(item))


def _is_dragged(item: bpy.types.PropertyGroup, index: int, states: States) -> bool:
    gesture = _last_drag(item)
    return gesture is not None and index in gesture.moved and gesture.continues(gesture.moved, states[item.name].chosen)


# --- files, undo, keyframes ----------------------------------------------------------------------------------------
@session.handler("load_post", "undo_post", "redo_post", phase=session.Phase.SOLVE)
def _after_replacement(*_):
    """Continue the drags that the replaced colors came of; others have ended."""
    if rendering.is_running():
        return
    for scene in bpy.data.scenes:
        for item in scene.karf.objects:
            _recall(item)
        _remember_colors(scene)


def _recall(item: bpy.types.PropertyGroup) -> None:
    """Continue the drag stored in an object, if its colors came of it."""
    state, known, key = colors.state(item), session.get(_Memory).gestures, _key(item)
    if key in known and known[key].continues(known[key].moved, state.chosen):
        return
    known.pop(key, None)
    if not 0 < item.dragged < len(state.chosen) or not item.id_data.karf.material:
        return
    gesture = Gesture((item.dragged,), colors.stored(item, "began"), state.chosen)
    try:
        solved = solving.drag(state, gesture, displayed.of(item.id_data).histogram(state))
    except (KarfError, OSError):
        return
    if np.allclose(solved.chosen, state.chosen, atol=1e-5):
        known[key] = gesture


@session.handler("depsgraph_update_post", phase=session.Phase.SOLVE)
def _after_change(*_):
    if not rendering.is_running():
        for scene in bpy.data.scenes:
            _remember_colors(scene)


@session.handler("frame_change_post", phase=session.Phase.SOLVE)
def _follow_keyframes(scene, *_):
    """Update the swatches that follow keyframed ones: keyframes cause no property update."""
    if rendering.is_running():
        return
    objects = scene.karf.objects
    places = [
        (curve.object_name, curve.swatch, curve.tail[1:])
        for curve in keyframes.of(scene)
        if isinstance(curve.swatch, int)
        and curve.object_name in objects
        and curve.swatch < len(objects[curve.object_name].swatches)
    ]
    start = moved = colors.states(scene)
    for name, index, tail in dict.fromkeys(places):
        if tail == "color":
            moved = solve_sets(scene, solving.assign(moved, name, index, moved[name].chosen[index]), name, index)
        elif tail in colors.SURFACE:
            share_surface(objects[name], index)
    for name, index, tail in dict.fromkeys(places):
        if tail == "color" and scene.karf.material:
            moved = _move_paints(scene, start, moved, solving.linked(start, name, index), begins=False)
    if places:
        write(scene, moved)
    _remember_colors(scene)
