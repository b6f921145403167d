"""From a learned project to recolored pictures, also in the own pixels of photos."""
