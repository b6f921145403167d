"""The engine as a process of its own: what it needs, what it is asked, what it answers."""
