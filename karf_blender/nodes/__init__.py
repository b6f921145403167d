"""Tools for all node trees of KaRF: building nodes, and color sockets that follow swatches."""
