"""The message bus: who listens is known, and leaves with the extension. In background mode Blender delivers nothing."""


def test_a_listener_is_known_until_it_is_forgotten(bpy, addon):
    known, key = addon.session.get(addon.messages.Listeners).known[:], (bpy.types.Window, "scene")

    def listener():
        """Never called here."""

    for each in (key, (bpy.types.Area, "ui_type")):
        addon.messages.listen(each, listener)
    assert addon.session.get(addon.messages.Listeners).known == [
        *known,
        (key, listener),
        ((bpy.types.Area, "ui_type"), listener),
    ]
    addon.messages.forget(listener)
    assert addon.session.get(addon.messages.Listeners).known == known


def test_the_extension_listens_to_scenes_clicks_and_sidebars_and_stops(addon):
    def listened():
        return {(kind.__name__, name) for (kind, name), _ in addon.session.get(addon.messages.Listeners).known}

    sidebars = {("SpaceView3D", "show_region_ui"), ("SpaceImageEditor", "show_region_ui"), ("Area", "ui_type")}
    assert listened() == {("Window", "scene"), ("LayerObjects", "active"), *sidebars}
    addon.extension.unregister()
    assert not listened() & sidebars
    addon.extension.register()
    assert listened() > sidebars
