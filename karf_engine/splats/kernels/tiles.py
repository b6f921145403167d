"""Assignment of Gaussians to the tiles of a picture, from near to far."""

from __future__ import annotations

from ...compute.kernels import kernel

MAX_ENTRIES = 1 << 30  # 8 GiB of entries; the sums fit into int32


@kernel
def count_entries(boxes, tiles_x, offsets, starts):
    """Count the entries of each Gaussian and tile; return False, with nothing counted, above MAX_ENTRIES.

    Args:
        boxes: [n] of TILE_BOX.
        tiles_x: Tiles per row of the picture.
        offsets: [n + 1], output: first entry of each Gaussian in the order of the table.
        starts: [T + 1], zeros, output: first entry of each tile.
    """
    total = 0  # int64
    offsets[0] = 0
    for g in range(len(boxes)):
        box = boxes[g]
        total += (box.right - box.left) * (box.bottom - box.top)
        if total > MAX_ENTRIES:
            return False
        offsets[g + 1] = total
    for g in range(len(boxes)):
        box = boxes[g]
        for y in range(box.top, box.bottom):
            for x in range(box.left, box.right):
                starts[y * tiles_x + x + 1] += 1
    for tile in range(len(starts) - 1):
        starts[tile + 1] += starts[tile]
    return True


@kernel
def fill_entries(order, boxes, tiles_x, offsets, free, entries):
    """Write the entries of all tiles.

    Args:
        order: Visible Gaussians from near to far.
        boxes: [n] of TILE_BOX.
        tiles_x: Tiles per row of the picture.
        offsets: From `count_entries`.
        free: [T], first entry of each tile; overwritten.
        entries: [E] of ENTRY, output.
    """
    for g in order:
        box, row = boxes[g], offsets[g]
        for y in range(box.top, box.bottom):
            for x in range(box.left, box.right):
                entry = entries[free[y * tiles_x + x]]
                entry.gaussian, entry.row = g, row
                free[y * tiles_x + x] += 1
                row += 1
