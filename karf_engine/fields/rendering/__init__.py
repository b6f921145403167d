"""Volume rendering as plain functions of tensors."""
