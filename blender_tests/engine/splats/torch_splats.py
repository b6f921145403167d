"""Reference splatting as in the papers, in torch and double precision, with every Gaussian in every pixel."""

import torch

from karf_engine.splats.kernels.arrays import DARK, MAX_ALPHA, MIN_ALPHA

C0, C1 = 0.28209479177387814, 0.4886025119029199
C2 = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396)
C3 = (
    *(-0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154),
    *(-0.4570457994644658, 1.445305721320277, -0.5900435899266435),
)


def harmonics(directions):
    """All sixteen harmonics of unit directions [n, 3], [n, 16]."""
    x, y, z = directions.unbind(1)
    xx, yy, zz = x * x, y * y, z * z
    values = [torch.full_like(x, C0), -C1 * y, C1 * z, -C1 * x]
    values += [C2[0] * x * y, C2[1] * y * z, C2[2] * (2 * zz - xx - yy), C2[3] * x * z, C2[4] * (xx - yy)]
    values += [C3[0] * y * (3 * xx - yy), C3[1] * x * y * z, C3[2] * y * (4 * zz - xx - yy)]
    values += [C3[3] * z * (2 * zz - 3 * xx - 3 * yy), C3[4] * x * (4 * zz - xx - yy), C3[5] * z * (xx - yy)]
    return torch.stack([*values, C3[6] * x * (xx - 3 * yy)], 1)


def rotations(quaternions):
    """Rotations [n, 3, 3] of quaternions w x y z [n, 4] of any length."""
    w, x, y, z = (quaternions / torch.linalg.norm(quaternions, dim=1, keepdim=True)).unbind(1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def splat(table, camera, background):
    """Colors and transmittance [H, W, 4] of a table [n, 11 + 3 K], float64; `camera` is a kernels' Pinhole."""
    turn = torch.from_numpy(camera.rotation.reshape(3, 3)).double()
    at = table[:, :3] @ turn.T + torch.from_numpy(camera.translation).double()
    x, y, z = at.unbind(1)
    fx, fy = float(camera.fx), float(camera.fy)
    none = torch.zeros_like(x)
    jacobian = torch.stack(
        [torch.stack([fx / z, none, -fx * x / z**2], 1), torch.stack([none, fy / z, -fy * y / z**2], 1)], 1
    )
    axes = jacobian @ turn @ rotations(table[:, 6:10]) * table[:, None, 3:6].exp()
    sharp = axes @ axes.transpose(1, 2)
    covariance = sharp + float(camera.blur) * torch.eye(2, dtype=torch.float64)
    share = (torch.linalg.det(sharp) / torch.linalg.det(covariance)).clamp_min(float(camera.least_share)).sqrt()
    opacity = torch.sigmoid(table[:, 10]) * share
    directions = table[:, :3] - torch.from_numpy(camera.eye).double()
    directions = directions / torch.linalg.norm(directions, dim=1, keepdim=True)
    count = (table.shape[1] - 11) // 3
    colors = (
        0.5 + torch.einsum("nk,nkc->nc", harmonics(directions)[:, :count], table[:, 11:].view(-1, count, 3))
    ).clamp_min(0)
    v, u = torch.meshgrid(torch.arange(camera.height) + 0.5, torch.arange(camera.width) + 0.5, indexing="ij")
    center = torch.stack([fx * x / z + float(camera.cx), fy * y / z + float(camera.cy)], 1)
    apart = torch.stack([u, v], -1).double()[:, :, None] - center  # [H, W, n, 2]
    power = 0.5 * torch.einsum("hwni,nij,hwnj->hwn", apart, torch.linalg.inv(covariance), apart)
    alphas = opacity * torch.exp(-power)
    alphas = torch.where(alphas < float(MIN_ALPHA), torch.zeros_like(alphas), alphas.clamp_max(float(MAX_ALPHA)))
    front = (z >= float(camera.near)).nonzero()[:, 0]
    order = front[z[front].argsort()]
    alphas, colors = alphas[..., order], colors[order]
    light = torch.cumprod(1 - alphas, -1)
    before = torch.cat([torch.ones_like(light[..., :1]), light[..., :-1]], -1)
    image = (alphas * before) @ colors + light[..., -1:] * torch.tensor(background, dtype=torch.float64)
    assert light.min() > float(DARK) or len(table) < 40  # where the kernels stop
    return torch.cat([image, light[..., -1:]], -1)
