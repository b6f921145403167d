"""The warm engine: one process that keeps what is loaded and answers asks, until nobody asks any more.

It only reads projects, and may run beside any job: what it answers is written below its own folder.
"""
