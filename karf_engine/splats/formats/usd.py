"""Gaussians in USD files (.usd, .usda, .usdc; .usdz read only): UsdVol's prim ParticleField3DGaussianSplat.

Format: openusd.org, UsdVol's user guide: positions, scales (not logarithms), orientations, opacities, and
radiance:sphericalHarmonicsCoefficients, K per particle in the order of Kerbl et al., each in single or half precision.
The schema defines no color space; colors are read as display-referred sRGB, as trainers learn them. Files that declare
another one (ColorSpaceAPI, or the attribute's own) are refused: it is also the one in which Gaussians blend.

The table is written as in PLY, below a rotation by 180 degrees about x (see `UPRIGHT`), on a y-up stage in meters.
Transforms of prims are applied when reading, z up or y up; the unit is ignored. Files that refer to others are refused.

Precision: float32; opacity 2e-7, log scales 1e-5, unit quaternions 1e-6.
"""

# usd-core has no type stubs
# pyright: reportAttributeAccessIssue=false
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import DataError
from ...io.files import atomic_write, check_file
from ..gaussians import DEGREES
from ..kernels.arrays import C0, COLOR, LOG_SCALE, LOGIT, ROTATION
from ..similarity import transform_table
from .splat_file import (
    UPRIGHT,
    SplatFile,
    damaged,
    explaining,
    log_scales,
    logits,
    needing_packages,
    opacities,
    unit_rotations,
    usable,
)

if TYPE_CHECKING:
    from pxr import Sdf, Usd

NAME = "/Gaussians"
MOST_PRIMS = 10_000  # of the composed stage
SIGMAS = 3  # of a Gaussian, for the bounds
HARMONICS = "radiance:sphericalHarmonicsCoefficients"
# sRGB by its name in USD and by 3DGRUT's, and the names that declare nothing
SRGB = ("srgb_rec709_scene", "srgb_rec709_display", "", "raw", "data", "identity", "unknown")
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # into y up


def read(path: Path) -> SplatFile:
    """Read all Gaussians of a USD file, transformed by its prims, in the axes of PLY."""
    check_file(path)
    with explaining(path):
        from pxr import Tf

        try:
            return usable(path, np.concatenate(_tables(path)))
        except Tf.ErrorException as error:  # its message may hold undecodable bytes
            raise damaged(path, "usd-core cannot read it") from error


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians as text (.usda) or binary (.usdc, .usd); columns are dropped."""

    def write_stage(temporary: Path) -> None:
        with needing_packages():
            stage = _new_stage(splats.table)
        if not stage.GetRootLayer().Export(str(temporary)):
            raise OSError(f"{temporary} cannot be written")

    atomic_write(path, write_stage)


# --------------------------------------------------------------------------------------------------------------- reading
def _tables(path: Path) -> list[np.ndarray]:
    """Return the table of each prim of Gaussians."""
    from pxr import Usd, UsdGeom

    stage = _stage(path)
    axes = UPRIGHT @ (Z_UP if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else np.eye(4))
    tables = []
    for number, prim in enumerate(stage.Traverse(Usd.TraverseInstanceProxies())):
        if number == MOST_PRIMS:  # instances multiply without taking memory, and so without a limit
            raise damaged(path, f"it has more than {MOST_PRIMS:,} prims, those that appear again by references counted")
        if prim.GetTypeName() == "ParticleField3DGaussianSplat":
            _check_colors(path, prim)
            matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T
            tables.append(transform_table(_table(path, prim), axes @ matrix))
    if not tables:
        raise damaged(path, "it has no ParticleField3DGaussianSplat")
    return tables


def _stage(path: Path) -> Usd.Stage:
    """Open the stage of a file that refers to no other."""
    from pxr import Sdf, Usd

    layer = Sdf.Layer.OpenAsAnonymous(str(path))
    others = [*filter(None, layer.GetCompositionAssetDependencies()), *_with_clips(layer)]
    if others:
        raise DataError(f"{path} refers to other files, such as {others[0]}.", "Flatten it: usdcat --flatten.")
    stage = Usd.Stage.Open(layer, Usd.Stage.LoadNone)
    errors = stage.GetCompositionErrors()
    if errors:
        raise damaged(path, f"its prims cannot be composed ({errors[0]})")
    return stage


def _with_clips(layer: Sdf.Layer) -> list[str]:
    """Return the prims, also of variants, with value clips, which refer to other files."""
    paths: list[Sdf.Path] = []
    layer.Traverse(layer.pseudoRoot.path, paths.append)
    prims = filter(None, map(layer.GetPrimAtPath, paths))
    return [f"the value clips of {prim.path}" for prim in prims if prim.HasInfo("clips")]


def _check_colors(path: Path, prim: Usd.Prim) -> None:
    """Raise DataError if a prim, one above it or its colors themselves declare another color space than sRGB."""
    from pxr import Usd

    attributes = [prim.GetAttribute(name) for name in (HARMONICS, f"{HARMONICS}h")]
    for attribute in filter(Usd.Attribute.HasValue, attributes):
        declared = Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, None)
        space = declared or prim.GetAttribute("colorSpace:name").Get() or ""  # also without the schema applied
        if space not in SRGB:
            raise DataError(
                "{path} has Gaussians in the color space {space!r}; sRGB is read.",
                "Export them in sRGB, as trainers learn them from photos, or as .ply.",
                path=path,
                space=str(space),
            )


def _table(path: Path, prim: Usd.Prim) -> np.ndarray:
    """Return the table [n, 11 + 3 K] float32 of a prim."""
    degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get()
    if degree not in DEGREES.values():
        raise damaged(path, f"its harmonics are of degree {degree}; 0 to 3 are read")
    centers = _values(prim, "positions")
    n_harmonics = (degree + 1) ** 2
    harmonics = _values(prim, HARMONICS)[: len(centers) * n_harmonics]
    parts = (
        centers,
        log_scales(_values(prim, "scales")),
        np.roll(_values(prim, "orientations"), 1, 1),  # usd-core stores the real part last
        logits(_values(prim, "opacities").reshape(-1, 1)),
        harmonics.reshape(-1, 3 * n_harmonics),
    )
    if any(len(part) < len(centers) for part in parts):
        raise damaged(path, f"{prim.GetPath()} has fewer values than its {len(centers):,} positions")
    return np.concatenate([part[: len(centers)] for part in parts], 1, dtype=np.float32)


def _values(prim: Usd.Prim, name: str) -> np.ndarray:
    """Return an attribute as float32, from its single-precision form or else from the half-precision one."""
    for each in (name, f"{name}h"):
        value = prim.GetAttribute(each).Get()
        if value is not None and len(value):
            return np.array(value, np.float32)
    raise ValueError(f"{prim.GetPath()} has no {name}")


# --------------------------------------------------------------------------------------------------------------- writing
def _new_stage(table: np.ndarray) -> Usd.Stage:
    from pxr import Usd, UsdGeom, UsdVol, Vt

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, NAME)
    stage.SetDefaultPrim(field.GetPrim())
    field.AddRotateXOp().Set(180.0)
    centers, harmonics = table[:, :LOG_SCALE], table[:, COLOR:].reshape(-1, 3)
    scales = np.exp(table[:, LOG_SCALE:ROTATION].astype(np.float64))
    reach = SIGMAS * scales.max(1, keepdims=True)
    extent = np.stack([(centers - reach).min(0), (centers + reach).max(0)])
    colors = np.clip(0.5 + C0 * table[:, COLOR : COLOR + 3], 0, 1)
    field.CreatePositionsAttr(_array(Vt.Vec3fArray, centers))
    field.CreateScalesAttr(_array(Vt.Vec3fArray, scales))
    field.CreateOrientationsAttr(_array(Vt.QuatfArray, np.roll(unit_rotations(table), -1, 1)))
    field.CreateOpacitiesAttr(_array(Vt.FloatArray, opacities(table[:, LOGIT])))
    field.CreateRadianceSphericalHarmonicsDegreeAttr(DEGREES[(table.shape[1] - COLOR) // 3])
    field.CreateRadianceSphericalHarmonicsCoefficientsAttr(_array(Vt.Vec3fArray, harmonics))
    field.CreateExtentAttr(_array(Vt.Vec3fArray, extent))
    field.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(_array(Vt.Vec3fArray, colors))
    return stage


def _array(kind: Any, values: np.ndarray) -> Any:
    return kind.FromNumpy(np.ascontiguousarray(values, np.float32))
