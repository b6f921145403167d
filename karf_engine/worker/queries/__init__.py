"""What a worker is asked beside its jobs: short questions about what is learned, answered by what it keeps in memory.

Queries only read projects, and may be answered beside any job of another worker: their files are written below the
folder of the job that answers them.
"""
