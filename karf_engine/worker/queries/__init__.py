"""Queries: short questions about a project, answered from memory.

Queries only read projects, so they may run beside any job of another worker. Their files are written below the folder of
the answering job.
"""
