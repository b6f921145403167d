"""Step 6: the looks that were kept, one in a row; and the key that flips two of them."""

import bpy

from ..swatches import looks

KEY = "V"  # free in the Image Editor of Blender's own key map


def draw_looks(layout, context):
    """A button for each look, the one in use pressed, with a star once the swatches have moved on."""
    karf = context.scene.karf
    row = layout.row(align=True)
    row.operator("karf.keep_look", icon="ADD")
    if len(karf.looks) > 1:
        row.operator("karf.flip_looks", text="", icon="ARROW_LEFTRIGHT")
    column = layout.column(align=True)
    for look in karf.looks:
        draw_look(column.row(align=True), look)


def draw_look(row, look):
    """A look's button, the one that keeps what has changed, and its menu."""
    karf = look.id_data.karf
    is_used = look.name == karf.look
    is_changed = is_used and looks.is_changed(look.id_data)
    text = f"{look.name} *" if is_changed else look.name
    icon = "RADIOBUT_ON" if is_used else "RADIOBUT_OFF"
    row.operator("karf.choose_look", text=text, icon=icon, depress=is_used, translate=False).name = look.name
    if is_changed:
        row.operator("karf.keep_look", text="", icon="FILE_TICK").name = look.name
    row.context_pointer_set("karf_look", look)
    row.menu("KARF_MT_look", text="", icon="DOWNARROW_HLT")


class KARF_MT_look(bpy.types.Menu):
    """Actions for this look"""

    bl_label = "Look"

    def draw(self, context):
        layout, name = self.layout, context.karf_look.name
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator("karf.keep_look", text="Keep Swatches Here", icon="FILE_TICK").name = name
        layout.operator("karf.rename_look", text="Rename").name = name
        layout.separator()
        for text, icon, by in (("Move Up", "TRIA_UP", -1), ("Move Down", "TRIA_DOWN", 1)):
            move = layout.operator("karf.move_look", text=text, icon=icon)
            move.name, move.by = name, by
        layout.separator()
        layout.operator("karf.remove_look", text="Remove", icon="X").name = name
