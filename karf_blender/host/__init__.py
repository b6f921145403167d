"""Blender as the host: what differs between its versions, its handlers, its message bus, its windows, whether it renders."""
