"""What a USD layer is composed of, looked at before usd-core composes it.

A prim may refer to other files, and to other prims of its own: each of these appears in its place with all that is below
it, so that a few lines of references double themselves without end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pxr import Sdf

MOST_PRIMS = 10_000  # of the composed stage
CLIPS = "clips"  # metadata of a prim: its attributes have values that lie in other files


def other_files(layer: Sdf.Layer) -> list[str]:
    """The files that a layer refers to.

    usd-core's own function for it ends the process where a spec is missing.

    Raises:
        ValueError: The layer names prims that are not in it.
    """
    prims = _prims(layer)
    composing = (arcs for prim in prims for arcs in (prim.referenceList, prim.payloadList))
    return [
        *layer.subLayerPaths,
        *(arc.assetPath for arcs in composing for arc in arcs.GetAddedOrExplicitItems() if arc.assetPath),
        *(f"the value clips of {prim.path}" for prim in prims if prim.HasInfo(CLIPS)),
    ]


def check_size(layer: Sdf.Layer) -> None:
    """Refuse a layer whose stage would have more prims than are read, all variants counted.

    Raises:
        ValueError: It would, or a prim refers to one that is not in the layer.
    """
    waiting, count = list(layer.rootPrims), 0
    while waiting:
        prim = waiting.pop()
        waiting += _appearing_in(prim)
        count += 1
        if count + len(waiting) > MOST_PRIMS:
            raise ValueError(f"it has more than {MOST_PRIMS:,} prims, those that appear again by references counted")


def _appearing_in(prim: Sdf.PrimSpec) -> Iterator[Sdf.PrimSpec]:
    """The prims below one, in all of its variants, and those that it takes over."""
    yield from prim.nameChildren
    for variants in prim.variantSets:
        yield from (variant.primSpec for variant in variants.variants)
    arcs = [arc for each in (prim.referenceList, prim.payloadList) for arc in each.GetAddedOrExplicitItems()]
    paths = [arc.primPath or prim.layer.GetDefaultPrimAsPath() for arc in arcs]
    paths += [path for each in (prim.inheritPathList, prim.specializesList) for path in each.GetAddedOrExplicitItems()]
    for path in paths:
        target = prim.layer.GetPrimAtPath(path)
        if target is None:
            raise ValueError(f"{prim.path} refers to {path}, which is not in it")
        yield target


def _prims(layer: Sdf.Layer) -> list[Sdf.PrimSpec]:
    """All prims, those of variants too."""
    from pxr import Sdf

    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    if not all(layer.GetObjectAtPath(path) for path in paths):
        raise ValueError("it names prims that are not in it")
    prims = (layer.GetPrimAtPath(path) for path in paths if path.IsPrimPath() or path.IsPrimVariantSelectionPath())
    return list(filter(None, prims))
