"""Propose the mask of an object in one photo from a box, clicks or a lasso; start with `proposals`."""
