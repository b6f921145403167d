"""Devices, CPU cores, compiled kernels, distributed training and progress reports."""
