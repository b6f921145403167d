"""Camera poses and sparse points from photos, and frames from videos."""
