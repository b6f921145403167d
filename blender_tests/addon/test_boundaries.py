"""Import rules: the engine without bpy, Blender's side without torch and threads, and packages in layers."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from ..layering import violations

ROOT = Path(__file__).resolve().parents[2]
OWN = ("karf_engine", "karf_blender")
# files of the extension that run without Blender
PURE = ("engine_api", "swatches/solving", "engine/failures", "engine/processes", "engine/worker", "engine/installer/*")
# the packages of karf_blender, lowest layer first: each may import only lower layers
FLOORS = (
    ("session",),
    ("engine_api", "translations"),
    *((name,) for name in ("host", "progress", "engine", "preferences", "project", "pictures", "nodes")),
    ("compositor", "rig", "surface", "swatches", "tasks"),
    ("marking", "render_engine", "workspace"),
    ("properties", "steps"),
    ("operators", "panels"),
    ("__init__",),
)
BLENDER_PACKAGES = {"bpy", "bmesh", "mathutils", "gpu", "bl_ext"}
THREADS = {"threading", "_thread", "concurrent", "multiprocessing", "asyncio"}
ENGINE_PACKAGES = {"torch", "scipy", "PIL", "imageio", "safetensors", "filelock", "cv2", "OpenEXR", "pycolmap", "numba"}


def sources(folder):
    files = sorted((ROOT / folder).rglob("*.py"))
    assert files
    return files


def imports(path):
    """(number of dots, top package) of every import in a file; `from . import name` gives (1, name)."""
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module]
        yield from ((getattr(node, "level", 0), name.partition(".")[0]) for name in names)


def importers(folder, packages, *, relative):
    """The names of the files that import a package, by any import or only by absolute ones."""
    found = [(path.name, *each) for path in sources(folder) for each in imports(path)]
    return {name for name, dots, package in found if package in packages and (relative or not dots)}


@pytest.mark.parametrize(
    ("folder", "forbidden"),
    [("karf_engine", BLENDER_PACKAGES), ("karf_blender", ENGINE_PACKAGES), ("karf_blender", THREADS)],
    ids=["Blender in the engine", "engine packages in Blender", "threads in Blender"],
)
def test_forbidden_packages_are_not_imported(folder, forbidden):
    assert importers(folder, forbidden, relative=False) == set()


def test_only_engine_api_imports_the_engine():
    assert importers("karf_blender", {"karf_engine"}, relative=True) == {"engine_api.py"}


@pytest.mark.parametrize("folder", OWN)
def test_imports_within_the_extension_are_relative(folder):
    # run as a folder __main__ has no package to be relative to
    assert importers(folder, OWN, relative=False) <= {"__main__.py"}


def test_only_compat_reads_blenders_version():
    readers = [path.name for path in sources("karf_blender") if "app.version" in path.read_text()]
    assert readers == ["compat.py"]


def test_shared_modules_import_with_only_numpy():
    folder = ROOT / "karf_blender"
    files = [file for name in PURE for file in sorted(folder.glob(f"{name}.py"))]
    modules = [".".join(("shared.karf_blender", *file.relative_to(folder).with_suffix("").parts)) for file in files]
    assert len(modules) > 8
    code = f"""
import importlib, sys, types
sys.modules.update(dict.fromkeys({sorted(ENGINE_PACKAGES | {"bpy", "mathutils"})}))
for name, folder in (("shared", {str(ROOT)!r}), ("shared.karf_blender", {str(folder)!r})):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = [folder]  # without __init__, which needs Blender
for name in {modules}:
    importlib.import_module(name)
engine = [name for name in sys.modules if name.startswith("shared.karf_engine.")]
assert len(engine) > 60, engine
"""
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_packages_import_only_lower_layers():
    assert violations(ROOT / "karf_blender", FLOORS) == []


UPWARDS = "ground.wood imports tools.drill, but tools is on a higher floor."
HOUSE = {"tools/drill": "", "tools/__init__": ""}
CIRCLE = {"tools/a": "from .b import x", "tools/b": "from . import c", "tools/c": "from .a import y"}
SAWS = {"saw": "from . import drill", "drill": ""}


@pytest.mark.parametrize(
    ("sources", "floors", "sentences"),
    [
        (HOUSE | {"ground/wood": "from ..tools import drill"}, (("ground",), ("tools",)), [UPWARDS]),
        (
            HOUSE | {"ground/wood": "def f(): from .. import tools"},
            (("ground",), ("tools",)),
            [UPWARDS.replace("drill", "__init__")],
        ),
        (SAWS, (("drill", "saw"),), ["saw imports drill, but drill is on the same floor."]),
        (CIRCLE, (("tools",),), ["A circle: tools.a imports tools.b imports tools.c imports tools.a."]),
        (
            {"attic": ""},
            (("cellar",),),
            ["The room attic is on no floor of the table.", "The room cellar of the table is not in the package."],
        ),
    ],
)
def test_imports_against_the_layers_are_reported(tmp_path, sources, floors, sentences):
    for name, source in sources.items():
        path = (tmp_path / "house" / name).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)
    assert violations(tmp_path / "house", floors) == sentences
