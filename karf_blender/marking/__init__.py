"""Marking objects in photos: the masks being drawn, their files and undo, the tools and the overlay of the Image Editor."""
