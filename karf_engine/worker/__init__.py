"""The engine as a child process: the protocol of jobs and queries, and the loop that serves them."""
