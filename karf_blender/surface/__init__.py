"""The learned scene as an object: colored faces on its surface that follow the swatches, and files of them."""
