"""Tints of objects."""

from itertools import combinations


def test_an_object_keeps_its_color_and_its_place_when_it_is_renamed(bpy, addon, learned):
    addon.objects.sync(learned)
    for name in ("zebra", "bowl"):
        addon.steps.add_object(learned, name)

    def tints():
        return {item.name: addon.objects.tint(item) for item in learned.karf.marking.objects}

    before, order = tints(), list(learned.karf.marking.objects.keys())
    learned.karf.marking.objects["zebra"].name = "can"
    expected = {("can" if name == "zebra" else name): tint for name, tint in before.items()}
    assert tints() == expected and len(set(before.values())) == 4
    assert addon.object_masks.in_order(learned, ["pot", "lid", "other"]) == [
        *(name for name in order if name in ("lid", "pot")),
        "other",
    ]


def test_the_masks_have_the_colors_of_the_list(bpy, addon, learned):
    addon.objects.sync(learned)
    learned.karf.marking.objects["pot"].number = 5
    bpy.context.window_manager.karf_seeing.show_masks = True
    addon.displayed.of(learned).load_masks()
    masks = addon.displayed.of(learned).known_masks()
    assert masks.tints["pot"] == addon.tints.tint_of(5) == addon.objects.tint(learned.karf.marking.objects["pot"])
    bpy.context.window_manager.karf_seeing.show_masks = False


def test_tints_of_eight_objects_can_be_told_apart(addon):
    lab = addon.engine_api.srgb_to_lab([addon.tints.tint_of(index) for index in range(8)])
    assert min(addon.engine_api.ciede2000(first, second) for first, second in combinations(lab, 2)) > 15
    assert addon.tints.tint_of(8) == addon.tints.tint_of(0)
