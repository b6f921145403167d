"""Tasks: engine jobs run beside the user interface or in a script, and the scenes that they belong to."""
