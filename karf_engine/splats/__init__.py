"""A learned scene as Gaussians: begun on the surface of its voxels, refined on the photos, shown in milliseconds."""
