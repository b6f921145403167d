"""The heads of F_s and F_w: fields, training, rendering along rays, and files."""
