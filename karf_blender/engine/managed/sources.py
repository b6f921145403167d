"""Where packages come from, as uv and pip are set up on this computer; KaRF itself names no place. No bpy."""

import configparser
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

UV_VARIABLES = ("UV_DEFAULT_INDEX", "UV_INDEX_URL")
PIP_VARIABLE = "PIP_INDEX_URL"


@dataclass(frozen=True)
class Source:
    """sentence: where packages come from. variables: the environment variables that pass it to uv."""

    sentence: str
    variables: dict[str, str] = field(default_factory=dict)


def find(variables: Mapping[str, str], wheels: Path | None = None) -> Source:
    """Where packages will come from: a folder, the index that uv is set to, that of pip, else the usual one.

    Args:
        variables: The process's environment.
        wheels: A folder of wheels, in place of the network.
    """
    if wheels is not None:
        return Source(f"the folder {wheels}, without network")
    for name in UV_VARIABLES:
        if variables.get(name):
            return Source(f"the index {shown(variables[name])} (variable {name})")
    if variables.get(PIP_VARIABLE):
        url = variables[PIP_VARIABLE]
        return Source(f"the index {shown(url)} (variable {PIP_VARIABLE})", {"UV_DEFAULT_INDEX": url})
    for path in _pip_files(variables):
        url = _index_in(path)
        if url:
            return Source(f"the index {shown(url)} (of {path})", {"UV_DEFAULT_INDEX": url})
    return Source("the Python Package Index (or another, where uv.toml names one)")


def shown(url: str) -> str:
    """An address without the password in it.

    Examples:
        >>> shown("https://name:p@ss@mirror.example/simple")
        'https://mirror.example/simple'
    """
    return re.sub(r"(?<=//)[^/?#]*@", "", url)


def _pip_files(variables: Mapping[str, str]) -> Iterator[Path]:
    """pip's files of settings, the user's own first, as its documentation lists them."""
    if variables.get("PIP_CONFIG_FILE"):
        yield Path(variables["PIP_CONFIG_FILE"])
    home = Path(variables.get("HOME") or variables.get("USERPROFILE") or os.curdir)
    if os.name == "nt":
        roots = [variables.get(name, "") for name in ("APPDATA", "PROGRAMDATA")]
        yield from (Path(root) / "pip" / "pip.ini" for root in roots if root)
        return
    own = Path(variables.get("XDG_CONFIG_HOME") or home / ".config")
    yield from (own / "pip" / "pip.conf", home / ".pip" / "pip.conf")
    yield home / "Library" / "Application Support" / "pip" / "pip.conf"
    yield from (Path("/etc/xdg/pip/pip.conf"), Path("/etc/pip.conf"))


def _index_in(path: Path) -> str:
    parser = configparser.RawConfigParser()
    try:
        parser.read(path, encoding="utf-8")
    except (OSError, configparser.Error, UnicodeDecodeError):
        return ""
    return next(
        (parser[name]["index-url"] for name in ("install", "global") if parser.has_option(name, "index-url")), ""
    )
