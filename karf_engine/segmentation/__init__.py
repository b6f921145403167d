"""Turn coarse masks into labelled surface points and F_s. `marking` proposes the masks."""
