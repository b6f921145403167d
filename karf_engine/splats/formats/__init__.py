"""Files of Gaussians that other programs read and write; one module for each kind of file."""
