"""A project: the folder of everything learned from a capture. Needs no torch."""

from .folder import Project
from .state import BUILT_ON, STAGE_ORDER, STAGE_VERSIONS

__all__ = ["BUILT_ON", "STAGE_ORDER", "STAGE_VERSIONS", "Project"]
