"""Every reader of files that a user or a stranger gives, and how to feed it files that are nearly right."""
