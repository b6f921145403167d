"""A segmentation in memory, which a stroke corrects in a second or two where the stage takes many.

The surface points, their neighbors and the labels that the masks give them are found once. A correction adds the rays of
its own view and changes these labels, as the stage does (`labels.Labelling`). Masks of a view show the labelled points
that its rays hit: so they need no F_s, which the stage learns anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from ..capture.capture import Capture, View
from ..compute.progress import Progress
from ..fields.protocol import Field
from ..project.settings import Settings
from ..project.volumes import Volume
from .coarse_masks import CoarseMask
from .constraints import SeenPoints
from .labels import Labelling
from .suggestions import Suggestions, views_to_mark
from .surface_points import surface_points
from .views import cache_views, load_masked_views
from .votes import votes_of_rays


class Correcting:
    """The labels of a scene's surface after any number of corrections, and masks of any view.

    Attributes:
        objects: names of the K objects, also of those that have corrections alone.
        labels: of the surface points, as solved last.
    """

    def __init__(
        self,
        scene_field: Field,
        capture: Capture,
        masks: Sequence[CoarseMask],
        corrections: Sequence[CoarseMask],
        settings: Settings,
        progress: Progress,
        volumes: Mapping[str, Sequence[Volume]] = MappingProxyType({}),
    ) -> None:
        """Label the surface.

        Args:
            scene_field: the frozen radiance field.
            capture: the project's.
            masks: at least one.
            corrections: all that there are so far; later ones may be of other views, but only of the same objects.
            settings: that the scene was learned with.
            progress: counts the pixels of the views whose surface is looked at.
            volumes: that objects must be inside or outside of, by their names.

        Raises:
            DataError: a mark or a photo cannot be read, or nothing stands for an object.
        """
        own, long_side = settings.segmentation, settings.geometry.long_side
        marked = {mask.view.name for mask in masks}
        learned_from = [view for view in capture.views if view.split == "train" or view.name in marked]
        views = load_masked_views(masks, learned_from, long_side, own, {each.object_name for each in corrections})
        self._cached = cached = cache_views(scene_field, views, own.samples_per_ray, progress)
        points = surface_points(cached, scene_field.voxel)
        self.objects = views.objects
        self._seen = SeenPoints(scene_field, points, long_side)
        self._labelling = Labelling.of(scene_field, points, votes_of_rays(cached), self.objects, volumes)
        constraints = self._seen.constraints(corrections, self.objects)
        random = np.random.default_rng(settings.seed)
        self._of_masks = self._labelling.solve(self.objects, constraints, own.rounds, random)
        self.labels = self._labelling.corrected(self._of_masks, constraints)

    def correct(self, corrections: Sequence[CoarseMask]) -> None:
        """Solve again with these corrections, all that there are."""
        constraints = self._seen.constraints(corrections, self.objects)
        self.labels = self._labelling.corrected(self._of_masks, constraints)

    def suggestions(self) -> Suggestions:
        """The views to mark next; see `suggestions.views_to_mark`."""
        return views_to_mark(self._cached, self._labelling.points, self.labels)

    def masks(self, view: View) -> dict[str, np.ndarray]:
        """The objects' masks in a view as its pinhole shows it, at the working size, bool [H, W]."""
        look, n_classes = self._seen.look(view), len(self.objects) + 1
        of_points = np.concatenate([self.labels.probabilities, np.eye(n_classes)[:1]])  # -1 is the last
        rays = of_points[look.point_of_sample].mean(1) * look.cache.opacity.cpu().numpy()[:, None]
        rays[:, 0] += 1 - rays.sum(1)
        picture = np.zeros(look.size, int)
        picture.flat[look.cache.index.cpu().numpy()] = rays.argmax(1)
        return {name: picture == k for k, name in enumerate(self.objects, 1)}
