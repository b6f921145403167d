"""One module a stage: read inputs, call rooms, write artifacts."""
