"""One module a command: `run(options, emit, should_stop)` reads inputs, calls rooms and writes files."""
