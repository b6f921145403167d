"""Edit planes that match what a project has learned."""

from karf_engine.palettes.compositing import write_planes
from karf_engine.project import Project
from karf_engine.project.state import result_fingerprint


def write_current_planes(addon, scene, planes):
    """Write current edit planes of the scene's active view."""
    project = Project(addon.folders.project_of(scene).folder)
    fingerprint = result_fingerprint(project.state(), "recoloring")
    write_planes(project.planes_file(scene.karf.active_view), planes, fingerprint)
