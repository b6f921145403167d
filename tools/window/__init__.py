"""Stories of an artist in a real Blender window, by mouse and keys: docs/window_story.md.

Here: `__main__`, `preparation`, `capture`, `blender`, `screen`. Inside Blender: `inside`; the chapters of `story`
(`learning`, `editing`, `controls`, `pictures`, `keeping`; `first_color`), told with `telling`, `acts`, `desk`, `hands`, `menus`,
`pickers`, `remains`. Both: `record`.
"""
