"""Photos as their files hold them, and edited copies of them: own size, depth, color profile and metadata."""

from .stored import StoredPhoto, open_photo
from .writing import suffix_for, write_mask, write_photo

__all__ = ["StoredPhoto", "open_photo", "suffix_for", "write_mask", "write_photo"]
