"""How good a capture is before anything is learned of it: from photos, cameras and masks alone, in seconds."""
