"""The paper's radiance field, a NeRF, its fit, and NeRFs that other programs have trained."""
