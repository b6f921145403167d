"""The marking tools in the Image Editor: toolbar, unregistration and keymaps."""

NAMES = ["karf.mark_box", "karf.mark_click", "karf.mark_lasso", "karf.mark_brush"]


def test_tools_are_in_the_toolbar(addon):
    from bl_ui.space_toolsystem_common import ToolSelectPanelHelper as Helper

    toolbar = Helper._tool_class_from_space_type("IMAGE_EDITOR")
    tools = [tool.idname for tool in Helper._tools_flatten(toolbar._tools["VIEW"]) if tool]
    assert [name for name in tools if name.startswith("karf.")] == NAMES


def test_unregistering_deselects_an_active_tool(bpy, addon, image_editor):
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, area=image_editor):
        addon.tools.take_up(bpy.context, image_editor)
    assert window.workspace.tools.from_space_image_mode("VIEW").idname == "karf.mark_box"
    addon.extension.unregister()
    assert window.workspace.tools.from_space_image_mode("VIEW").idname == addon.tools.BLENDERS
    addon.extension.register()


def test_tool_keys_are_distinct_and_call_existing_operators(bpy, addon):
    for tool in addon.tools.TOOLS:
        presses = [tuple(sorted(event.items())) for _, event, _ in tool.bl_keymap]
        assert len(set(presses)) == len(presses)
        for operator, _, options in tool.bl_keymap:
            room, name = operator.split(".")
            known = getattr(getattr(bpy.ops, room), name).get_rna_type().properties
            assert all(key in known for key, _ in options["properties"])
