"""Files: reading, writing and checking them; names that become files; colors; pictures."""
