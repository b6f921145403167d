"""The session: what the extension keeps in memory, and what it has put into Blender.

A module keeps state in a class of its own, whose one object `get` returns. What Blender calls is declared where it is
defined: classes by their name (KARF_...), handlers by `handler`, everything else by `setup`. `register` finds and
installs it all, in any order of modules.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from enum import IntEnum
from types import ModuleType
from typing import Any, TypeVar

import bpy

T = TypeVar("T")
Timer = Callable[[], float | None]  # returns the seconds until the next call; None: no more


class Phase(IntEnum):
    """When a handler is called among the handlers of an event."""

    STATE = 0  # what other handlers depend on: which file is open, whether Blender renders
    READ = 1  # reads files of projects
    SOLVE = 2  # colors that follow other colors
    SHOW = 3  # pictures, drivers and panels
    REPORT = 4  # messages about what the others did


class _Session:
    """The state of the extension from `register` to `unregister`."""

    def __init__(self) -> None:
        self.states: dict[type, Any] = {}
        self.timers: set[Timer] = set()
        self.listeners: list[Callable] = []
        self.installed = ExitStack()


_session = _Session()


# --- state ---------------------------------------------------------------------------------------------------------
def get(kind: type[T]) -> T:
    """Return the session's object of a class, created on first use.

    A class may define `close()`, called before its object is dropped, `prune()`, called after scenes may have gone,
    and `per_file = True`: its object is dropped when another file is opened.
    """
    known = _session.states.get(kind)
    if known is None:
        known = _session.states[kind] = kind()
    return known


def prune() -> None:
    """Drop what belongs to scenes that are gone."""
    for state in tuple(_session.states.values()):
        if hasattr(state, "prune"):
            state.prune()


def clear(per_file: bool = False) -> None:
    """Close and drop all state; with `per_file`, only what belongs to the file that was open."""
    for kind in tuple(_session.states):
        if not per_file or getattr(kind, "per_file", False):
            if hasattr(kind, "close"):
                _session.states[kind].close()
            del _session.states[kind]


# --- declarations --------------------------------------------------------------------------------------------------
def handler(*events: str, phase: Phase = Phase.SHOW) -> Callable[[Callable], Callable]:
    """Declare a function as a handler of these lists of `bpy.app.handlers`; it stays when a file is opened."""

    def declare(function: Callable) -> Callable:
        function.karf_events, function.karf_phase = events, phase
        return bpy.app.handlers.persistent(function)

    return declare


def listener(event: str) -> Callable[[Callable], Callable]:
    """Declare a function that is called whenever an event of the extension's own is announced by `notify`."""

    def declare(function: Callable) -> Callable:
        function.karf_listens = event
        return function

    return declare


def notify(event: str, *values: Any) -> None:
    """Call all listeners of an event."""
    for function in _session.listeners:
        if function.karf_listens == event:
            function(*values)


def setup(function: Callable[[], Iterator[None]]) -> Callable[[], Iterator[None]]:
    """Declare a generator function that installs something, yields once, and removes it again."""
    function.karf_setup = contextmanager(function)
    return function


def start_timer(timer: Timer, seconds: float = 0.02, persistent: bool = False) -> None:
    """Call a function after some seconds, and then as often as it says; it ends with the session.

    Callers make sure that Blender has an interface: in background mode timers never fire.
    """
    if not bpy.app.timers.is_registered(timer):
        bpy.app.timers.register(timer, first_interval=seconds, persistent=persistent)
    _session.timers.add(timer)


def stop_timer(timer: Timer) -> None:
    """Call a function of `start_timer` no more."""
    _session.timers.discard(timer)
    if bpy.app.timers.is_registered(timer):
        bpy.app.timers.unregister(timer)


# --- registration --------------------------------------------------------------------------------------------------
def register(package: ModuleType) -> None:
    """Install everything that the modules of a package declare; where that fails, nothing stays installed."""
    modules = [package, *_submodules(package)]
    with ExitStack() as stack:
        for each in _in_order(_classes(modules)):
            bpy.utils.register_class(each)
            stack.callback(bpy.utils.unregister_class, each)
        for function in _functions(modules, "karf_setup"):
            stack.enter_context(function.karf_setup())
        for function in sorted(_functions(modules, "karf_events"), key=lambda each: each.karf_phase):
            for event in function.karf_events:
                called = getattr(bpy.app.handlers, event, [])  # older Blenders lack some, such as exit_pre
                called.append(function)
                stack.callback(called.remove, function)
        _session.listeners = _functions(modules, "karf_listens")
        stack.callback(_end)  # first: what still runs may need all of the above
        _session.installed = stack.pop_all()


def unregister() -> None:
    """Remove everything again: timers end, state is closed, handlers and classes go."""
    _session.installed.close()


@handler("exit_pre", phase=Phase.REPORT)
def _end(*_) -> None:
    # a timer left behind hangs or crashes some Blender versions at exit
    for timer in tuple(_session.timers):
        stop_timer(timer)
    clear()


def _submodules(package: ModuleType) -> Iterator[ModuleType]:
    for found in sorted(pkgutil.walk_packages(package.__path__, f"{package.__name__}."), key=lambda each: each.name):
        yield importlib.import_module(found.name)


def _functions(modules: list[ModuleType], mark: str) -> list[Callable]:
    found = (value for module in modules for value in vars(module).values() if inspect.isfunction(value))
    return list(dict.fromkeys(each for each in found if hasattr(each, mark)))


def _classes(modules: list[ModuleType]) -> list[type]:
    """Blender's classes that modules define: by their own name, or in a tuple `CLASSES` where they are made in a loop."""
    found = (value for module in modules for value in (*vars(module).values(), *getattr(module, "CLASSES", ())))
    return list(dict.fromkeys(each for each in found if inspect.isclass(each) and each.__name__.startswith("KARF_")))


def _in_order(classes: list[type]) -> list[type]:
    """Sort classes so that each comes after those that it names: its groups of properties, or its parent panel."""
    names = {getattr(each, "bl_idname", each.__name__): each for each in classes}
    ordered: dict[type, None] = {}

    def add(each: type) -> None:
        for other in _needed(each, names):
            add(other)
        ordered.setdefault(each)

    # panels that have the same parent are shown by `bl_order`, then as they are registered
    for each in sorted(classes, key=lambda each: getattr(each, "bl_order", 0)):
        add(each)
    return list(ordered)


def _needed(each: type, names: dict[str, type]) -> Iterator[type]:
    if getattr(each, "bl_parent_id", "") in names:
        yield names[each.bl_parent_id]
    for base in each.__mro__:
        for declared in inspect.get_annotations(base).values():
            group = getattr(declared, "keywords", {}).get("type")
            if group in names.values():
                yield group


@handler("load_post", phase=Phase.STATE)
def _after_load(*_):
    clear(per_file=True)
