"""One module a stage: read inputs, call rooms, write artifacts. Each has `run(request, emit, should_stop)`."""
