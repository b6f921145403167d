"""Which Gaussians each tile of a picture shows, from near to far: sorted once, then dealt out to the tiles in order."""

from __future__ import annotations

from ...compute.kernels import kernel

MOST_ENTRIES = 1 << 30  # 8 GiB of them; slots and starts hold twice as many


@kernel
def count_entries(tiles, tiles_x, slots, starts):
    """Count entries; returns whether they are at most MOST_ENTRIES, else nothing is counted.

    Args:
        tiles: [n] of TILES.
        tiles_x: Tiles of a row of the picture.
        slots: [n + 1]: becomes the first slot of each Gaussian, which has one for each of its tiles.
        starts: [T + 1], zeros: becomes the first entry of each tile.
    """
    total = 0  # of 64 bits
    slots[0] = 0
    for g in range(len(tiles)):
        box = tiles[g]
        total += (box.right - box.left) * (box.bottom - box.top)
        if total > MOST_ENTRIES:
            return False
        slots[g + 1] = total
    for g in range(len(tiles)):
        box = tiles[g]
        for y in range(box.top, box.bottom):
            for x in range(box.left, box.right):
                starts[y * tiles_x + x + 1] += 1
    for tile in range(len(starts) - 1):
        starts[tile + 1] += starts[tile]
    return True


@kernel
def fill_entries(order, tiles, tiles_x, slots, free, entries):
    """Write the entries of all tiles.

    Args:
        order: The seen Gaussians from near to far.
        tiles: [n] of TILES.
        tiles_x: Tiles of a row of the picture.
        slots: As counted.
        free: [T], the first entry of each tile; used up.
        entries: [S] of ENTRY.
    """
    for g in order:
        box, slot = tiles[g], slots[g]
        for y in range(box.top, box.bottom):
            for x in range(box.left, box.right):
                entry = entries[free[y * tiles_x + x]]
                entry.gaussian, entry.slot = g, slot
                free[y * tiles_x + x] += 1
                slot += 1
