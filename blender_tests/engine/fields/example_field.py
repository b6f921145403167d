"""An example field of soft colored balls that `geometry.field=balls` learns; docs/extending.md explains it."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from karf_engine.fields.extent import box_around_focus
from karf_engine.fields.fit import FitInputs
from karf_engine.fields.registry import FieldKind, register_field
from karf_engine.fields.rendering.sampling import Samples
from karf_engine.fields.rendering.space import Box
from karf_engine.fields.rendering.volume import Trace, accumulate, make_trace, outward_normals
from karf_engine.fields.scene import Scene
from karf_engine.fields.training import TrainingState, constant, train

BALLS, RADIUS, DENSEST, SAMPLES, RAYS, ITERATIONS = 64, 0.16, 20.0, 40, 192, 150


class BallField(nn.Module):
    kind, n_features, space = "balls", 3, Box()

    def __init__(self, bounds: Tensor, centers: Tensor) -> None:
        super().__init__()
        self.register_buffer("bounds", bounds)  # [2, 3]
        self.voxel = float((bounds[1] - bounds[0]).max()) / 64
        self.centers = nn.Parameter(centers)  # [B, 3]
        self.log_radii = nn.Parameter(torch.full_like(centers[:, 0], RADIUS).log())
        self.raw_densities = nn.Parameter(torch.zeros_like(centers[:, 0]))
        self.raw_colors = nn.Parameter(torch.zeros_like(centers))

    def _densities(self, positions: Tensor) -> Tensor:  # of each ball, [n, B]
        distances = torch.cdist(positions, self.centers) / self.log_radii.exp()
        return DENSEST * torch.sigmoid(self.raw_densities) * torch.exp(-(distances**2) / 2)

    def density(self, positions: Tensor) -> Tensor:
        return self._densities(positions).sum(1)

    def features(self, positions: Tensor) -> Tensor:
        return torch.softmax(torch.log(self._densities(positions) + 1e-6), 1) @ self.raw_colors

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor) -> Tensor:
        return torch.sigmoid(features)

    def trace(self, rays, step_in_voxels: float) -> Trace:
        first, last = self.space.paths(rays, *self.bounds).unbind(1)
        share = (torch.arange(SAMPLES, device=first.device) + 0.5) / SAMPLES
        positions = (first[:, None] + share[:, None] * (last - first)[:, None]).view(-1, 3)
        lengths = torch.linalg.norm(last - first, dim=1).repeat_interleave(SAMPLES)
        ray_indices = torch.arange(len(rays), device=first.device).repeat_interleave(SAMPLES)
        samples = Samples(ray_indices, lengths * share.repeat(len(rays)), positions, lengths / SAMPLES)
        return make_trace(samples, self.density(positions), len(rays))

    def normals(self, positions: Tensor) -> Tensor:
        return outward_normals(self.density, positions, self.voxel)

    def summary(self) -> dict:
        return {"balls": len(self.centers)}

    def config(self) -> dict:
        return {}  # the tensors are all it needs

    @classmethod
    def restore(cls, config: dict, tensors: dict[str, Tensor], device: torch.device) -> BallField:
        field = cls(tensors["bounds"], tensors["centers"])
        field.load_state_dict(tensors)
        return field.to(device)


class BallFit:
    def __init__(self, inputs: FitInputs) -> None:
        self.dataset, self.runtime = inputs.dataset, inputs.runtime
        center, half_width = box_around_focus(self.dataset.cameras, 0.75)
        bounds = torch.stack([center - half_width, center + half_width]).float().to(self.runtime.device)
        field = BallField(bounds, bounds[0] + 2 * half_width * self.runtime.rand(BALLS, 3))
        self.scene = Scene(field, None, inputs.background_kind, step=1.0)
        adam = torch.optim.Adam(field.parameters(), 0.05)
        self.training_state = TrainingState(ITERATIONS, adam, field.state_dict, self.runtime)
        self.iterations, self.state, self.resume = ITERATIONS, self.training_state.state, self.training_state.resume

    done = property(lambda self: self.training_state.done)

    def scenes(self, progress, checkpoint=None):
        train(self.training_state, ITERATIONS, self._step, constant, progress, checkpoint)
        yield self.scene

    def _step(self, iteration: int, batch_scale: float) -> tuple[Tensor, dict[str, float]]:
        index = self.dataset.draw(max(1, int(RAYS * batch_scale)), self.runtime)
        rays, field = self.dataset.rays(index), self.scene.field
        trace = field.trace(rays, self.scene.step)
        positions, ray_indices = trace.samples.positions, trace.samples.ray_indices
        colors = field.color(positions, rays.viewdirs[ray_indices], field.features(positions))
        behind = trace.final_transmittance[:, None] * self.scene.background_color(rays.viewdirs)
        shown = accumulate(trace.ray_weights, colors, ray_indices, len(rays)) + behind
        loss = nn.functional.mse_loss(shown, self.dataset.color[index].float() / 255)
        return loss, {"psnr": float(-10 * loss.detach().log10())}


register_field(BALLS_KIND := FieldKind(BallField.kind, BallFit, BallField.restore))
