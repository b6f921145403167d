"""The version of engine and extension."""

__version__ = "0.1.0"
