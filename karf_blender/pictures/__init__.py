"""Pictures: pixels to and from Blender, the editors that show them, captured photos, painted masks."""
