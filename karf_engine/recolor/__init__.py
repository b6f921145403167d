"""Loading a learned project, rendering it, and recoloring its photos at full resolution."""
