"""3D Gaussian splatting: initialization from a learned field, training on photos, rasterization, imports."""
