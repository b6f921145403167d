"""Run the engine on another computer: `python -m karf_engine.remote`."""
