"""Jobs for a render farm, as Open Job Description has them: bundles that any farm, or `openjd run`, can work off."""

from .bundle import learning_bundle, render_bundle

__all__ = ["learning_bundle", "render_bundle"]
