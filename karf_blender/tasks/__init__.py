"""Tasks: engine jobs run alongside the user interface or in a script, and the scenes that they belong to."""
