"""Marking objects in photos: masks, their files and undo, the tools and the overlay of the Image Editor."""
