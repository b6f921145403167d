"""The running job in the status bar, in the session in which the extension was installed too."""

import pytest


@pytest.fixture
def drawn(bpy, addon):
    """A question: how often the status bar draws what is ours."""
    return lambda: bpy.types.STATUSBAR_HT_header.draw._draw_funcs.count(addon.statusbar.draw)


def test_what_an_installation_puts_back_draws_the_job_too(bpy, addon, drawn):
    workspace, header = bpy.data.workspaces[0], bpy.types.STATUSBAR_HT_header
    addon.extension.unregister()
    header.draw = header.draw._draw_funcs[0]  # nothing was ever added in this session
    if hasattr(header, "_draw_orig"):
        del header._draw_orig
    workspace.status_text_set("Installing")  # as the operator does that then enables the extension
    addon.extension.register()
    workspace.status_text_set(None)
    assert drawn() == 1


def test_a_tool_with_its_own_status_is_followed_by_the_job_again(bpy, addon, drawn):
    workspace = bpy.data.workspaces[0]
    workspace.status_text_set(lambda header, context: None)
    addon.extension.unregister()
    addon.extension.register()
    workspace.status_text_set(None)
    assert drawn() == 1
    addon.extension.unregister()
    assert drawn() == 0
    addon.extension.register()
