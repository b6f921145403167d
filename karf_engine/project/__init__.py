"""A project: the folder of all that is learned of a capture, and what can be read of it without torch."""

from .folder import Project
from .state import BUILT_ON, STAGE_ORDER, STAGE_VERSIONS

__all__ = ["BUILT_ON", "STAGE_ORDER", "STAGE_VERSIONS", "Project"]
