"""The operators: a file for each step of the panel, for the engine itself, and for how a job ends."""
