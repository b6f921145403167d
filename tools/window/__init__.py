"""An afternoon of an artist in a real Blender window, by mouse and keys: docs/window_story.md.

Here: `__main__`, `preparation`, `blender`, `screen`. Inside Blender: `inside`, `story`, `acts`, `desk`, `hands`,
`remains`. Both: `record`.
"""
