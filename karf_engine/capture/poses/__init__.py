"""Camera poses and sparse points of photos, and frames of videos."""
