"""How much of each pixel of a photo is an object's: from the field's rough answer and the photo's own edges."""
