"""The training loop, and the state and checkpoints of trainings."""
