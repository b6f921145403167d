"""Color properties."""

from bpy.props import FloatVectorProperty


def srgb(name: str, default: float = 0.0, highest: float = 1.0, **options):
    """A color property of sRGB numbers, as palettes are learned; the picker's bar ends at white."""
    limits = {"min": 0.0, "max": highest, "soft_max": 1.0}
    return FloatVectorProperty(name=name, subtype="COLOR_GAMMA", size=3, default=(default,) * 3, **limits, **options)
