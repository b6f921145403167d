"""A scene's files: where they lie, its capture and project as they are on disk, and how they move."""
