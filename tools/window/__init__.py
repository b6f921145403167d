"""An afternoon of an artist in a real Blender window, by mouse and keys: docs/window_story.md.

Here: `__main__`, `preparation`, `blender`, `screen`. Inside Blender: `inside`; the chapters of `story`
(`learning`, `editing`, `pictures`, `keeping`), told with `telling`, `acts`, `desk`, `hands`, `remains`. Both: `record`.
"""
