"""The session: what the extension keeps in memory, and what it has put into Blender.

A module keeps its state in its own class, and `get` returns the one object of that class. Functions that Blender calls
are declared beside their code: by `handler`, `draw_handler`, `subscribe` and `setup`; classes by their name (KARF_...).
`register` finds and installs them all, whatever the order of modules.
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
    """The order of the handlers of an event; those of one phase must not depend on each other."""

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
        self.listeners: list[Callable] = []  # of `listener`
        self.subscribers: list[Callable] = []  # of `subscribe`
        self.installed = ExitStack()


_session = _Session()


# --- state ---------------------------------------------------------------------------------------------------------
def get(kind: type[T]) -> T:
    """Return the session's object of a class, created on first use.

    A class may define `close()`, called before its object is dropped, and `per_file = True`: its object is dropped when
    another file is opened.
    """
    if kind not in _session.states:
        _session.states[kind] = kind()
    return _session.states[kind]


def clear(per_file: bool = False) -> None:
    """Close and drop all state; with `per_file`, only what belongs to the closed file."""
    for kind in tuple(_session.states):
        if not per_file or getattr(kind, "per_file", False):
            if hasattr(kind, "close"):
                _session.states[kind].close()
            _session.states.pop(kind, None)
    if not per_file:
        _session.states.clear()  # closing one may have created another


# --- declarations --------------------------------------------------------------------------------------------------
def _mark(**marks: Any) -> Callable[[Callable], Callable]:
    def declare(function: Callable) -> Callable:
        vars(function).update(marks)
        return function

    return declare


def handler(*events: str, phase: Phase = Phase.SHOW) -> Callable[[Callable], Callable]:
    """Declare a function as a handler of these lists of `bpy.app.handlers`; it stays when a file is opened."""
    declare = _mark(karf_events=events, karf_phase=phase)
    return lambda function: bpy.app.handlers.persistent(declare(function))


def subscribe(*properties: tuple[type, str]) -> Callable[[Callable], Callable]:
    """Declare a function to call when one of these properties of Blender types is set.

    Blender's message bus reports what the user and scripts set, but not undo; in background mode it reports nothing.
    """
    return _mark(karf_properties=properties)


def listener(event: str) -> Callable[[Callable], Callable]:
    """Declare a function to call whenever `notify` announces this event of the extension."""
    return _mark(karf_listens=event)


def notify(event: str, *values: Any) -> None:
    """Call all listeners of an event."""
    for function in _session.listeners:
        if function.karf_listens == event:
            function(*values)


def draw_handler(editor: type[bpy.types.Space], moment: str) -> Callable[[Callable], Callable]:
    """Declare a function that draws in the main region of editors of a type; `moment` is POST_PIXEL or POST_VIEW."""
    return _mark(karf_draws_in=editor, karf_draws=moment)


def setup(function: Callable[[], Iterator[None]]) -> Callable[[], Iterator[None]]:
    """Declare a generator function that installs something, yields once, and removes it again."""
    return _mark(karf_setup=contextmanager(function))(function)


# --- timers --------------------------------------------------------------------------------------------------------
def start_timer(timer: Timer, seconds: float = 0.02, persistent: bool = False) -> None:
    """Call a function after some seconds, and then as often as it says, unless it is called already.

    It ends with the session and, unless `persistent`, when another file is opened. In background mode timers never fire:
    callers do the work at once there.
    """
    if not bpy.app.timers.is_registered(timer):
        bpy.app.timers.register(timer, first_interval=seconds, persistent=persistent)
    _session.timers.add(timer)


def stop_timer(timer: Timer) -> None:
    """Stop calling a function of `start_timer`."""
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
        for function in _declared(modules, "karf_setup"):
            stack.enter_context(function.karf_setup())
        for function in _declared(modules, "karf_draws"):
            drawn = function.karf_draws_in.draw_handler_add(function, (), "WINDOW", function.karf_draws)
            stack.callback(function.karf_draws_in.draw_handler_remove, drawn, "WINDOW")
        for function in sorted(_declared(modules, "karf_events"), key=lambda each: each.karf_phase):
            for event in function.karf_events:
                called = getattr(bpy.app.handlers, event, [])  # older Blenders lack some, such as exit_pre
                called.append(function)
                stack.callback(called.remove, function)
        _session.listeners = _declared(modules, "karf_listens")
        _session.subscribers = _declared(modules, "karf_properties")
        _subscribe_all()
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
    for function in _session.subscribers:
        bpy.msgbus.clear_by_owner(function)
    clear()


@handler("load_post", phase=Phase.STATE)
def _after_load(*_) -> None:
    clear(per_file=True)
    _subscribe_all()


def _subscribe_all() -> None:
    """Subscribe to the message bus: each file has a new one."""
    for function in _session.subscribers:
        bpy.msgbus.clear_by_owner(function)
        for key in function.karf_properties:
            bpy.msgbus.subscribe_rna(key=key, owner=function, args=(), notify=function)


def _submodules(package: ModuleType) -> Iterator[ModuleType]:
    for found in sorted(pkgutil.walk_packages(package.__path__, f"{package.__name__}."), key=lambda each: each.name):
        yield importlib.import_module(found.name)


def _declared(modules: list[ModuleType], mark: str) -> list[Callable]:
    """Return the functions with a mark of a declaration."""
    found = (value for module in modules for value in vars(module).values() if inspect.isfunction(value))
    return list(dict.fromkeys(each for each in found if hasattr(each, mark)))


def _classes(modules: list[ModuleType]) -> list[type]:
    """Return the Blender classes of modules: by their own name, or in a tuple `CLASSES` if made in a loop."""
    found = (value for module in modules for value in (*vars(module).values(), *getattr(module, "CLASSES", ())))
    return list(dict.fromkeys(each for each in found if inspect.isclass(each) and each.__name__.startswith("KARF_")))


def _in_order(classes: list[type]) -> list[type]:
    """Sort classes so that each comes after those that it names: its groups of properties, or its parent panel."""
    names = {getattr(each, "bl_idname", each.__name__): each for each in classes}
    ordered: dict[type, None] = {}

    def add(each: type) -> None:
        properties = [declared for base in each.__mro__ for declared in inspect.get_annotations(base).values()]
        groups = [getattr(declared, "keywords", {}).get("type") for declared in properties]
        for other in (names.get(getattr(each, "bl_parent_id", "")), *groups):
            if other in names.values():
                add(other)
        ordered.setdefault(each)

    # panels that have the same parent are shown by `bl_order`, then as they are registered
    for each in sorted(classes, key=lambda each: getattr(each, "bl_order", 0)):
        add(each)
    return list(ordered)
