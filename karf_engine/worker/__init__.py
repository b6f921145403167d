"""The engine as a child process: one protocol for jobs and queries, and the loop that serves both."""
