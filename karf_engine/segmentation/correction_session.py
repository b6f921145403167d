"""Keep a segmentation in memory so that a stroke corrects it in a second or two.

Each correction changes the labels from the masks as the segmentation stage does (`labels.Labelling`). Masks are
rendered from the labelled points, without F_s.
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
from .corrections import ViewObserver
from .labels import Labelling
from .report import Suggestions, views_to_mark
from .surface_points import surface_points
from .views import cache_views, load_masked_views
from .votes import votes_of_rays


class CorrectionSession:
    """Label a scene's surface, correct the labels any number of times, and render masks of any view.

    Attributes:
        objects: names of the K objects, with those that have only corrections.
        labels: of the surface points, as last solved.
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
        """Label the surface. progress: counts the pixels of the cached views.

        Later corrections may be on other views, but only of the same objects. Raises DataError where a mark or a photo
        cannot be read, or no point belongs to any object.
        """
        own, long_side = settings.segmentation, settings.geometry.long_side
        views = load_masked_views(masks, capture.views, long_side, own, {each.object_name for each in corrections})
        self._cached = cached = cache_views(scene_field, views, own.samples_per_ray, progress)
        points = surface_points(cached, scene_field.voxel)
        self.objects = views.objects
        self._seen = ViewObserver(scene_field, points, long_side)
        self._labelling = Labelling.of(scene_field, points, votes_of_rays(cached), self.objects, volumes)
        constraints = self._seen.constraints(corrections, self.objects)
        random = np.random.default_rng(settings.seed)
        self._from_masks = self._labelling.solve(self.objects, constraints, own.rounds, random)
        self.labels = self._labelling.corrected(self._from_masks, constraints)

    def correct(self, corrections: Sequence[CoarseMask]) -> None:
        """Update the labels, given all corrections."""
        constraints = self._seen.constraints(corrections, self.objects)
        self.labels = self._labelling.corrected(self._from_masks, constraints)

    def suggestions(self) -> Suggestions:
        """Return the views to mark next."""
        return views_to_mark(self._cached, self._labelling.points, self.labels)

    def masks(self, view: View) -> dict[str, np.ndarray]:
        """Return each object's mask in the view's pinhole at the working size, bool [H, W]."""
        observed, n_classes = self._seen.observe(view), len(self.objects) + 1
        of_points = np.concatenate([self.labels.probabilities, np.eye(n_classes)[:1]])  # index -1 is background
        rays = of_points[observed.point_of_sample].mean(1) * observed.cache.opacity.cpu().numpy()[:, None]
        rays[:, 0] += 1 - rays.sum(1)
        picture = np.zeros(observed.size, int)
        picture.flat[observed.cache.index.cpu().numpy()] = rays.argmax(1)
        return {name: picture == k for k, name in enumerate(self.objects, 1)}
