"""Properties of colors."""

from bpy.props import FloatProperty, FloatVectorProperty

from ..engine_api import MAX_PROTECT, MAX_REACH, REACH


def srgb(name: str, default: float = 0.0, highest: float = 1.0, **options):
    """A color property of sRGB numbers, as palettes are learned; the picker's bar ends at white."""
    limits = {"min": 0.0, "max": highest, "soft_max": 1.0}
    return FloatVectorProperty(name=name, subtype="COLOR_GAMMA", size=3, default=(default,) * 3, **limits, **options)


def pigment_reach(**options):
    """A property for how far an added color reaches."""
    limits = {"default": REACH, "min": 0.05, "max": MAX_REACH, "soft_max": 2.0}
    return FloatProperty(
        name="Reach",
        description="Range of hues around the added color that belong to its pigment. For a gray, range of chroma",
        **limits,
        **options,
    )


def protected_neutrals(**options):
    """A property for how neutral colors must be to be left out of an added color's pigment."""
    limits = {"subtype": "FACTOR", "min": 0.0, "max": MAX_PROTECT}
    return FloatProperty(
        name="Protect Neutrals",
        description="Protect silver, foil, paper and gloss: exclude colors with less than this share of the "
        "pigment's saturation. 0: only the hue decides",
        **limits,
        **options,
    )
