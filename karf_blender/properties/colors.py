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
        description="How far around its hue (of a gray: its chroma) colors of the object are of this pigment",
        **limits,
        **options,
    )


def protected_neutrals(**options):
    """A property for how neutral colors must be to be left out of an added color's pigment."""
    return FloatProperty(
        name="Protect Neutrals",
        description="Silver, foil, paper and gloss stay as they are: colors whose saturation is under this share of the "
        "pigment's are not of it. 0: its hue alone decides",
        default=0.0,
        min=0.0,
        max=MAX_PROTECT,
        subtype="FACTOR",
        **options,
    )
