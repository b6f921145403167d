"""A robot uses the extension by mouse and keys in a real Blender window: docs/reliability.md.

Outside of Blender: `__main__`, `screen`. Inside Blender: `inside`, `story`, with `hands`, `controls`, `desk`, `remains`.
Both: `record`.
"""
