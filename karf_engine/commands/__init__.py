"""The commands, one module each: `run(options, emit, should_stop)` carries a command out.

`options.COMMANDS` is their registry, by name; `dispatch.run_command` runs any of them.
"""
