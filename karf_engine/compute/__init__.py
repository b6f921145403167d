"""The processor's cores, devices, compiled kernels, processes that learn together, progress."""
