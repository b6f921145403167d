"""The paper's radiance field, a NeRF: its fit, and the import of NeRFs trained elsewhere."""
