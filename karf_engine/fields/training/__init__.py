"""The training loop, and trainings that can be interrupted."""
