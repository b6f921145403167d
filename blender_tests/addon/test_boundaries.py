"""The walls between the rooms: no torch in Blender, no bpy in the engine, one door between them, no threads."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHARED = ["errors", "settings", "wire", "project", "capture", "edit"]
THREADS = {"threading", "_thread", "concurrent", "multiprocessing", "asyncio"}
ENGINE_PACKAGES = {"torch", "scipy", "PIL", "imageio", "safetensors", "filelock", "cv2", "OpenEXR", "pycolmap"}


def sources(folder):
    files = sorted((ROOT / folder).rglob("*.py"))
    assert files
    return files


def imports(path):
    """(dots, module) of every import in a file; `from . import name` gives (1, name)."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        if isinstance(node, ast.ImportFrom):
            names = [node.module] if node.module else [alias.name for alias in node.names]
            yield from ((node.level, name) for name in names)


def top(module):
    return module.partition(".")[0]


def offenders(folder, is_bad):
    return [(path.name, module) for path in sources(folder) for dots, module in imports(path) if is_bad(dots, module)]


def test_the_engine_never_imports_blender():
    names = {"bpy", "bmesh", "mathutils", "gpu", "bl_ext"}
    assert offenders("karf_engine", lambda dots, module: not dots and top(module) in names) == []


def test_the_blender_side_never_imports_what_only_the_engine_has():
    assert offenders("karf_blender", lambda dots, module: not dots and top(module) in ENGINE_PACKAGES) == []


def test_the_blender_side_has_no_threads():
    assert offenders("karf_blender", lambda dots, module: not dots and top(module) in THREADS) == []


def test_only_one_file_opens_the_door_to_the_engine():
    doors = {name for name, _ in offenders("karf_blender", lambda dots, module: top(module) == "karf_engine")}
    assert doors == {"engine_api.py"}


def test_imports_within_the_extension_are_relative():
    own = ("karf_engine", "karf_blender")
    found = [
        name for folder in own for name, _ in offenders(folder, lambda dots, module: not dots and top(module) in own)
    ]
    # run as a folder it has no package to be relative to
    assert set(found) <= {"__main__.py"}


def test_only_compat_asks_for_blenders_version():
    asking = [path.name for path in sources("karf_blender") if "app.version" in path.read_text()]
    assert asking == ["compat.py"]


@pytest.mark.parametrize("name", ["jobs", "environment", "lens", "processes", "report"])
def test_files_that_claim_to_need_no_blender_import_none(name):
    assert "bpy" not in [module for _, module in imports(ROOT / "karf_blender" / f"{name}.py")]


def test_shared_rooms_import_where_there_is_only_numpy():
    rooms = [path for room in SHARED for path in (ROOT / "karf_engine").glob(f"{room}*")]
    files = [file for room in rooms for file in ([room] if room.suffix == ".py" else room.rglob("*.py"))]
    modules = [".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for file in files]
    assert len(modules) >= 12
    blocked = sorted(ENGINE_PACKAGES | {"bpy", "mathutils"})
    code = f"""
import sys
sys.modules.update(dict.fromkeys({blocked}))
sys.path.insert(0, {str(ROOT)!r})
import importlib
for name in {modules}:
    importlib.import_module(name)
"""
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
