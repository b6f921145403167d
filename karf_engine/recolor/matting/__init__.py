"""Object mattes of photos, refined from the field's probabilities along the photo's own edges."""
