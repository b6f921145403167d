"""Working in it: how each step stands, which steps are folded, the status bar, the workspace."""
