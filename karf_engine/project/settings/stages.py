"""Settings of every stage as frozen dataclasses, with a help text and range for each field."""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any

from ...errors import BadRequest
from ...io.arguments import check_fields, check_number
from ...io.plugins import plugin_names

# functions that register another kind append its name
FIELD_KINDS = ["voxels", "nerf", *plugin_names("karf.fields")]
HEAD_KINDS = ["kan", "mlp", *plugin_names("karf.heads")]
LAYER_KINDS = ["grbf", "bspline", "mlp", *plugin_names("karf.layers")]
LABEL_KINDS = ["surface", "masks", "votes", *plugin_names("karf.labels")]


def setting(default: Any, help: str, minimum: float | None = None, maximum: float | None = None, choices=()) -> Any:
    """Return a dataclass field with its help text, range or choices; a list of choices may grow later."""
    return field(default=default, metadata={"help": help, "minimum": minimum, "maximum": maximum, "choices": choices})


def check_setting(item: Field, value: Any, name: str) -> None:
    """Raise BadRequest where a value is not one of a field's choices, or out of its range."""
    choices, minimum, maximum = (item.metadata.get(each) for each in ("choices", "minimum", "maximum"))
    if choices and value not in choices:
        raise BadRequest(f"{name} = {value!r:.200} is not allowed.", f"Use one of: {', '.join(choices)}.")
    if minimum is not None:
        check_number(name, value, minimum, maximum)


class Typed:
    """Settings that check the types of their fields and raise a TypeError; `Settings` also checks ranges."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Level(Typed):
    """One resolution of the coarse-to-fine geometry: cells along the longest side, iterations, step in voxels."""

    voxels: int
    iterations: int
    step: float


@dataclass(frozen=True)
class OpenSettings(Typed):
    """Open scenes, which extend behind the object and the cameras (contraction or frustum)."""

    levels: tuple[Level, ...] = setting(
        (Level(64, 150, 1.0), Level(128, 250, 1.0), Level(192, 300, 1.0)), "Coarse-to-fine levels"
    )
    samples: int = setting(110_000, "Samples an iteration; the number of rays follows", 1000, 10_000_000)
    max_rays: int = setting(8192, "Rays an iteration at most", 64, 1_000_000)
    table_rate: float = setting(0.3, "Learning rate of the voxel tables", 1e-5, 1.0)
    network_rate: float = setting(2e-2, "Learning rate of the color network", 1e-6, 0.1)
    total_variation: float = setting(2e-3, "Weight of the difference between neighboring vertices", 0.0, 1.0)
    distortion: float = setting(1e-2, "Weight of the spread of a ray's samples (Mip-NeRF 360)", 0.0, 1.0)
    transparency: float = setting(1e-3, "Weight of what rays do not end on", 0.0, 1.0)
    point_depth: float = setting(
        0.06, "Weight of the sparse points: a ray to a point ends there; a quarter of it in the last level", 0.0, 10.0
    )
    point_share: float = setting(0.2, "Share of the rays that go to sparse points", 0.0, 0.9)
    prune_alpha: float = setting(0.0, "Cells below this opacity are dropped", 0.0, 0.5)
    prune_visibility: float = setting(
        0.015, "Cells that no training ray sees by this weight are dropped; less beyond 256 voxels", 0.0, 0.5
    )
    radius: float = setting(
        1.0, "Radius that the contraction keeps, in half-widths of what a typical camera sees at the middle", 0.05, 10.0
    )
    frustum_detail: float = setting(1.4, "How much finer the cells of a frustum are: it holds less space", 0.5, 4.0)
    frustum_smoothness: float = setting(0.2, "Share of total_variation that counts in a frustum", 0.0, 10.0)
    room: float = setting(1.0, "Grid for what lies outside that radius, in radii", 0.1, 4.0)


@dataclass(frozen=True)
class NerfSettings(Typed):
    """The paper's radiance field, a vanilla NeRF: networks, samples and training."""

    depth: int = setting(8, "Layers before density and features", 2, 32)
    width: int = setting(256, "Width of the layers, and number of prior features", 4, 1024)
    position_frequencies: int = setting(10, "Octaves of the positional encoding", 1, 16)
    direction_frequencies: int = setting(4, "Octaves of the direction's encoding", 1, 8)
    coarse_samples: int = setting(64, "Samples a ray, spread evenly", 4, 1024)
    fine_samples: int = setting(128, "Samples a ray where the coarse network saw something", 1, 1024)
    near: float = setting(0.0, "Where rays begin, world units, but for NDC; 0: as cameras and points say", 0.0, 1e9)
    far: float = setting(0.0, "Where rays end, world units, but for NDC; 0: as cameras and points say", 0.0, 1e9)
    iterations: int = setting(120_000, "Training iterations", 1, 10_000_000)
    rays: int = setting(2048, "Rays an iteration", 16, 1_000_000)
    rate: float = setting(5e-5, "Learning rate", 1e-6, 0.1)
    decay_steps: int = setting(0, "Iterations in which the rate falls to a tenth; 0 keeps it", 0, 100_000_000)
    density_noise: float = setting(1.0, "Noise on raw densities while learning, forward-facing captures", 0.0, 10.0)
    crop_iterations: int = setting(
        500, "First iterations, in which rays go through the photos' middle (object captures)", 0, 1_000_000
    )
    look_every: int = setting(5000, "Iterations from one preview to the next", 1, 10_000_000)


@dataclass(frozen=True)
class GeometrySettings(Typed):
    """The radiance field: density and prior features. Fields outside `open` and `nerf` are for voxels in a box."""

    field: str = setting("voxels", "voxels: a sparse grid; nerf: the paper's", choices=FIELD_KINDS)
    long_side: int = setting(256, "Photos are reduced to this long side, pixels", 32, 4096)
    space: str = setting(
        "auto",
        "box: an object or a table top; contraction: all round; frustum: cameras that look one way",
        choices=("auto", "box", "contraction", "frustum"),
    )
    levels: tuple[Level, ...] = setting(
        (Level(40, 100, 1.0), Level(80, 200, 0.75), Level(136, 350, 0.75)), "Coarse-to-fine levels"
    )
    samples: int = setting(80_000, "Samples an iteration; the number of rays follows", 1000, 10_000_000)
    max_rays: int = setting(8192, "Rays an iteration at most", 64, 1_000_000)
    features: int = setting(12, "Prior features of the field", 3, 256)
    table_rate: float = setting(0.3, "Learning rate of the voxel tables", 1e-5, 1.0)
    network_rate: float = setting(1e-2, "Learning rate of the color and background networks", 1e-6, 0.1)
    depth_variance: float = setting(1e-4, "Weight of the spread of a ray's samples (opaque captures)", 0.0, 1.0)
    total_variation: float = setting(1e-5, "Weight of the difference between neighboring vertices", 0.0, 1.0)
    sparsity: float = setting(2e-3, "Weight of the mean sample alpha in the first level", 0.0, 1.0)
    opacity_entropy: float = setting(1e-3, "Weight of half-transparent rays (captures without background)", 0.0, 1.0)
    prune_alpha: float = setting(0.02, "Cells below this opacity are dropped", 0.0, 0.5)
    prune_visibility: float = setting(
        0.04, "Cells that no training ray sees by this weight are dropped; less beyond 256 voxels", 0.0, 0.5
    )
    open: OpenSettings = OpenSettings()
    nerf: NerfSettings = NerfSettings()


@dataclass(frozen=True)
class HeadSettings(Typed):
    """The head of a field on top of the frozen scene."""

    head: str = setting("kan", "kan: gated KAN block (Eq. 6); mlp: two hidden layers", choices=HEAD_KINDS)
    layer: str = setting("grbf", "Layer of the KAN block", choices=LAYER_KINDS)
    variant: str = setting("all", "Parts of Eq. 6", choices=("all", "no_residual", "gate", "none"))
    width: int = setting(64, "Width of the head", 4, 1024)
    match: str = setting(
        "width",
        "width: as wide as `width` says; parameters: with as many parameters as the full block of Gaussian layers",
        choices=("width", "parameters"),
    )
    centers: int = setting(8, "N of Eq. 5, Gaussian centers on [-2, 2]", 2, 8)
    bandwidth: str = setting(
        "eq5",
        "h of Eq. 5 at the start; eq5: the centers' spacing; fastkan: spacing / sqrt 2; xkanerf: 1 / sqrt 2",
        choices=("eq5", "fastkan", "xkanerf"),
    )
    learn_bandwidth: bool = setting(True, "Whether h is learned, one for each layer")
    schedule: str = setting(
        "cosine", "Learning rate; cosine: warmed up, then falling; constant: as given", choices=("cosine", "constant")
    )


@dataclass(frozen=True)
class SegmentationSettings(HeadSettings):
    """From coarse masks to the segmentation field F_s (stage 1)."""

    labels: str = setting(
        "surface",
        "surface: clean the masks on the surface; masks: plain Eq. 12; votes: take them as exact",
        choices=LABEL_KINDS,
    )
    frequencies: int = setting(5, "Octaves of the positional encoding", 0, 16)
    iterations: int = setting(150, "Training iterations", 1, 1_000_000)
    batch: int = setting(1024, "Surface points (or rays) an iteration", 16, 1_000_000)
    rate: float = setting(3e-3, "Learning rate", 1e-6, 0.1)
    cache_views: int = setting(24, "Training views whose surface is cached", 1, 1000)
    cache_long_side: int = setting(128, "Long side at which unmarked views are cached, pixels", 32, 4096)
    samples_per_ray: int = setting(3, "Quantile samples a ray in the cache", 1, 256)
    rounds: int = setting(3, "Rounds of the label solve", 1, 50)


@dataclass(frozen=True)
class PaletteSettings(Typed):
    """Palettes from the colors of the segmented objects."""

    start: str = setting(
        "hull", "hull: of the object's colors; random: as many colors, drawn at random", choices=("hull", "random")
    )
    colors: int = setting(0, "Colors of a palette, black included; 0 finds the smallest faithful number", 0, 16)
    tolerance: float = setting(3.0 / 255, "RMS distance of colors outside the palette's hull", 0.0, 0.2)
    shared: bool = setting(False, "One palette for all objects, as in the paper")


@dataclass(frozen=True)
class RecoloringSettings(HeadSettings):
    """The recoloring field F_w and the learnable palette (stage 2), which the paper's tables and voxel rendering use."""

    frequencies: int = setting(6, "Octaves of the positional encoding", 0, 16)
    direction_frequencies: int = setting(2, "Octaves of the direction's encoding", 0, 8)
    iterations: int = setting(
        0, "Training iterations; 0: no F_w, palettes as extracted, palette weights by colors", 0, 1_000_000
    )
    batch: int = setting(512, "Rays an iteration", 16, 1_000_000)
    rate: float = setting(3e-3, "Learning rate", 1e-6, 0.1)
    weight_loss: float = setting(0.1, "lambda_w of Eq. 14", 0.0, 100.0)
    targets: str = setting(
        "star",
        "Weights that Eq. 13 asks for; star: functions of the photo's color; loco: LoCoPalettes', of color and place",
        choices=("star", "loco"),
    )
    supervision: str = setting(
        "all",
        "Views whose weights Eq. 13 asks for; all: that were cached; reference: that are marked, as in the paper",
        choices=("all", "reference"),
    )
    background: str = setting(
        "none",
        "none: only rays well inside the objects teach F_w; black: all rays do, and the background learns to be black, "
        "as in the paper",
        choices=("none", "black"),
    )
    palette_loss: float = setting(1.0, "lambda_p of Eq. 14", 0.0, 100.0)
    palette_share: float = setting(0.4, "Last share of the iterations in which the palette is learned too", 0.0, 1.0)
    palette_rate: float = setting(5e-4, "Learning rate of the palette", 0.0, 0.1)


@dataclass(frozen=True)
class SplatSettings(Typed):
    """The scene as Gaussians, for cameras away from the photos."""

    iterations: int = setting(900, "Training iterations, each of one photo; 0: no Gaussians", 0, 1_000_000)
    count: int = setting(40_000, "About how many Gaussians there are", 1000, 5_000_000)
    long_side: int = setting(256, "Photos are reduced to this long side, pixels", 32, 16384)
    degree: int = setting(2, "Degree of the spherical harmonics: how colors change with the direction", 0, 3)


@dataclass(frozen=True)
class RenderSettings(Typed):
    """Rendering. Changes do not require learning again."""

    edges: str = setting(
        "photo",
        "Where objects end in captured views; photo: where the photo says; field: where the voxels do",
        choices=("photo", "field"),
    )
    preview: int = setting(1024, "Long side of captured views in Blender, pixels; the photo's at most", 64, 16384)
    source: str = setting(
        "splats",
        "What other cameras are rendered from; splats: Gaussians, where they are learned; field: voxels",
        choices=("splats", "field"),
    )
    supersampling: int = setting(1, "Rays a pixel along each side, of cameras that took no photo", 1, 4)
    unseen: str = setting(
        "faded",
        "What splats show that no photo does, or only from elsewhere; faded: gray; shown: whatever they hold",
        choices=("faded", "shown"),
    )


@dataclass(frozen=True)
class Settings(Typed):
    """All stages, the seed, and the name of the preset they came from.

    Raises:
        TypeError: A field is of another type.
        BadRequest: A value, also within a stage, is out of its range, or none of its choices.

    Example:
        settings = with_overrides(PRESETS["demo"], ["geometry.long_side=512"])
    """

    preset: str = "demo"
    seed: int = setting(0, "Seed of every random number", 0, 2**31 - 1)
    compositing: str = setting(
        "delta",
        "What an edit means that does not say: delta: add the palette's change; paper: replace by the palette's mixture",
        choices=("delta", "paper"),
    )
    geometry: GeometrySettings = GeometrySettings()
    segmentation: SegmentationSettings = SegmentationSettings()
    palette: PaletteSettings = PaletteSettings()
    recoloring: RecoloringSettings = RecoloringSettings()
    splats: SplatSettings = SplatSettings()
    render: RenderSettings = RenderSettings()

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_settings(self, "")


def _check_settings(settings: Any, where: str) -> None:
    for item in fields(settings):
        value = getattr(settings, item.name)
        check_setting(item, value, f"{where}{item.name}")
        if is_dataclass(value):
            _check_settings(value, f"{where}{item.name}.")
