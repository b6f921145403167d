"""What faults and damaged files do to projects and readers: docs/reliability.md."""
