"""A project: the folder in which all lives that is learned of a capture, and what it says without torch."""

from .folder import Project
from .state import STAGE_ORDER

__all__ = ["STAGE_ORDER", "Project"]
