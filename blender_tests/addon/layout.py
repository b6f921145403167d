"""A stand-in for Blender's UI layout."""

from types import SimpleNamespace


class Layout:
    """Checks what is drawn and records it; `controls` are the names that a user reads of what can be clicked."""

    opens_advanced = True

    def __init__(self, bpy, drawn, controls=None):
        self._bpy, self._drawn, self.controls = bpy, drawn, [] if controls is None else controls

    def _add(self, *texts, icon="NONE", **_):
        assert icon in self._bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
        self._drawn.extend(texts)

    def row(self, **_):
        return type(self)(self._bpy, self._drawn, self.controls)

    column = box = grid_flow = split = row

    def panel(self, name, default_closed=False):
        return self.row(), self.row()

    def panel_prop(self, data, name):
        """Open, to check its content too."""
        assert name in data.bl_rna.properties
        is_open = self.opens_advanced or data.bl_rna.identifier != "KARF_PG_advanced"
        return self.row(), self.row() if is_open else None

    def popover(self, panel, text="", **options):
        self._add(text, **options)
        getattr(self._bpy.types, panel).draw(SimpleNamespace(layout=self.row()), self._bpy.context)

    def label(self, text="", **options):
        self._add(text, **options)

    def separator(self):
        """Nothing is drawn."""

    def context_pointer_set(self, name, data):
        """Nothing is drawn."""

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self._add(text)

    def prop(self, data, name, text=None, **options):
        assert name in data.bl_rna.properties
        self.controls.append(data.bl_rna.properties[name].name if text is None else text)
        self._add(name, **options)

    def prop_enum(self, data, name, value, **options):
        self.prop(data, name, **options)
        assert value in data.bl_rna.properties[name].enum_items

    def prop_search(self, data, name, where, collection, **options):
        assert collection in where.bl_rna.properties
        self.prop(data, name, **options)

    def template_ID(self, data, name, open=""):
        self.prop(data, name)

    def template_list(self, kind, name, data, collection, active_data, active, **_):
        assert hasattr(self._bpy.types, kind)
        assert collection in data.bl_rna.properties and active in active_data.bl_rna.properties
        self.controls.append("")
        self._add(kind)

    def menu(self, name, text="", **options):
        assert hasattr(self._bpy.types, name)
        self.controls.append(text)
        self._add(name, **options)

    def operator(self, name, text=None, **options):
        self.controls.append(self._type_of(name).name if text is None else text)
        self._add(text or "", name, **options)
        return Properties(self._properties_of(name))

    def operator_menu_enum(self, name, enum, **options):
        assert enum in self._properties_of(name)
        self.controls.append(self._type_of(name).name)
        self._add(**options)

    def _properties_of(self, operator):
        return set(self._type_of(operator).properties.keys())

    def _type_of(self, operator):
        group, _, verb = operator.partition(".")
        return getattr(getattr(self._bpy.ops, group), verb).get_rna_type()


class Properties:
    """An operator's properties as the layout returns them."""

    def __init__(self, names):
        object.__setattr__(self, "names", names)

    def __setattr__(self, name, value):
        assert name in self.names


def drawn_preferences(bpy, preferences):
    """All text drawn in the extension's preferences, as one string."""
    drawn = []
    type(preferences).draw(SimpleNamespace(layout=Layout(bpy, drawn), bl_rna=preferences.bl_rna), None)
    return " ".join(drawn)
