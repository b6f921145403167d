"""The KaRF workspace comes with its editors, once, and brings nothing else into the file."""


def test_the_button_adds_the_workspace_once_and_nothing_else(bpy, addon, scene):
    kinds = ("scenes", "objects", "images", "brushes", "node_groups")
    before = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    for _ in range(2):
        assert bpy.ops.karf.open_workspace() == {"FINISHED"}
    (workspace,) = [each for each in bpy.data.workspaces if each.name.startswith("KaRF")]
    (screen,) = workspace.screens
    assert sorted(area.type for area in screen.areas) == ["DOPESHEET_EDITOR", "IMAGE_EDITOR", "VIEW_3D"]
    sided = [area.spaces.active.show_region_ui for area in screen.areas if area.type != "DOPESHEET_EDITOR"]
    assert sided == [True, True]
    assert {kind: len(getattr(bpy.data, kind)) for kind in kinds} == before


def test_the_file_that_it_comes_from_is_small(addon):
    assert addon.opening.FILE.stat().st_size < 100_000
