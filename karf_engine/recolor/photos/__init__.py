"""Photos as stored in their files, and edited copies with the same size, bit depth, color profile and metadata."""

from .stored import StoredPhoto, open_photo
from .writing import suffix_for, write_mask, write_photo

__all__ = ["StoredPhoto", "open_photo", "suffix_for", "write_mask", "write_photo"]
