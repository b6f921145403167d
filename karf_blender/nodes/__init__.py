"""What node trees of several rooms share: sockets of swatches, drivers that let them follow, a material without light."""
