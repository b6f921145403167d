"""The session holds all state, timers, draw handlers and message bus subscriptions, and ends them in time."""

import ast
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "karf_blender"


@pytest.fixture
def session(addon):
    yield addon.session
    addon.extension.unregister()
    addon.extension.register()


def test_state_is_closed_with_its_file_or_the_session(bpy, addon, session):
    closed = []
    of_file = type("OfFile", (), {"per_file": True, "close": lambda self: closed.append("file")})
    of_session = type("OfSession", (), {"close": lambda self: closed.append("session")})
    first, second = session.get(of_file), session.get(of_session)
    assert session.get(of_file) is first and session.get(of_session) is second
    bpy.ops.wm.read_homefile(use_empty=True)
    assert closed == ["file"] and session.get(of_session) is second
    session.get(of_file)
    addon.extension.unregister()
    addon.extension.register()
    assert sorted(closed) == ["file", "file", "session"]


def test_timers_start_once_and_end_with_the_session(bpy, addon, session):
    def timer():
        """Never called here."""

    session.start_timer(timer, 60)
    session.start_timer(timer, 60)
    assert bpy.app.timers.is_registered(timer)
    session.stop_timer(timer)
    assert not bpy.app.timers.is_registered(timer)
    session.start_timer(timer, 60, persistent=True)
    addon.extension.unregister()
    addon.extension.register()
    assert not bpy.app.timers.is_registered(timer)


def test_draw_handlers_are_added_and_removed(addon, session):
    drawn, package = [], ModuleType("package")

    def add(function, arguments, region, moment):
        drawn.append((function, region, moment))

    editor = SimpleNamespace(draw_handler_add=add, draw_handler_remove=lambda handler, region: drawn.pop())

    @session.draw_handler(editor, "POST_VIEW")
    def draw():
        """Never called here."""

    package.__path__, package.draw = [], draw
    addon.extension.unregister()
    session.register(package)
    assert drawn == [(draw, "WINDOW", "POST_VIEW")]
    session.unregister()
    addon.extension.register()
    assert not drawn


def test_each_file_subscribes_to_scenes_clicks_sidebars_and_shading(bpy, addon, session, monkeypatch):
    sidebars = {("SpaceView3D", "show_region_ui"), ("SpaceImageEditor", "show_region_ui"), ("Area", "ui_type")}
    shading = {("View3DShading", "type"), ("RenderSettings", "engine")}
    expected = {("Window", "scene"), ("LayerObjects", "active"), *sidebars, *shading}
    subscribed, owners = set(), set()

    def subscribe(key, owner, args, notify):
        subscribed.add((key[0].__name__, key[1]))
        owners.add(owner)

    bus = SimpleNamespace(subscribe_rna=subscribe, clear_by_owner=owners.discard)
    fake_bpy = SimpleNamespace(app=bpy.app, types=bpy.types, utils=bpy.utils, msgbus=bus)
    monkeypatch.setattr(session, "bpy", fake_bpy)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert subscribed == expected and owners
    addon.extension.unregister()
    assert not owners
    addon.extension.register()
    assert owners


METHODS = set("add append clear discard extend insert pop popitem remove setdefault update cache_clear".split())
CONTAINERS = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp)


def assigned_names(*trees):
    nodes = [node for tree in trees for node in ast.walk(tree)]
    return {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}


def changed_names(tree):
    """Yield the names of objects that are changed_names in place."""
    owners = [node for node in ast.walk(tree) if isinstance(node, ast.Subscript | ast.Attribute)]
    for node in (each for each in owners if isinstance(each.value, ast.Name)):
        if not isinstance(node.ctx, ast.Load) or getattr(node, "attr", "") in METHODS:
            yield node.value.id


def module_state(source):
    """The module-level names that a module's functions change, and containers that all objects of a class share."""
    tree = ast.parse(source)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    cached = {node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.decorator_list}
    top = cached | assigned_names(*(node for node in tree.body if isinstance(node, ast.Assign | ast.AnnAssign)))
    found = {name for each in ast.walk(tree) if isinstance(each, ast.Global) for name in each.names}
    found |= {name for each in functions for name in changed_names(each)} & (top - assigned_names(*functions))
    for kind in (each for each in tree.body if isinstance(each, ast.ClassDef) and not each.name.startswith("KARF_")):
        shared = [node for node in kind.body if isinstance(getattr(node, "value", None), CONTAINERS)]
        found |= {f"{kind.name}.{name}" for name in assigned_names(*shared) - {"bl_options"}}
    return found


def test_only_the_session_keeps_state():
    found = {path.relative_to(FOLDER).as_posix(): module_state(path.read_text()) for path in FOLDER.rglob("*.py")}
    assert found.pop("session.py") == {"_session"}
    assert {name: names for name, names in found.items() if names} == {}
