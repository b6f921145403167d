"""The extension as it is released: its zip, a repository that Blender can be pointed at, and their checksums."""
