"""A scene's files: their paths, its capture, its project on disk, and moving it."""
