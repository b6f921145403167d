"""From a box, clicks or a lasso to the mask of an object in one photo; `proposals` is the way in."""
