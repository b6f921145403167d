"""What all node trees of KaRF share: building nodes, and color sockets that follow swatches."""
