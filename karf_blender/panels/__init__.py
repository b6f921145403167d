"""The KaRF tab of the sidebar, in the 3D View and in the Image Editor. Drawing only reads."""
