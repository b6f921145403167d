"""Blender as the host: what differs between its versions, its handlers, its windows, whether it renders."""
