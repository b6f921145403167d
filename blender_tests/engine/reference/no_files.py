"""Makers of things that are not files (on Windows only folders), each called with a path."""

import os

NO_FILES = [os.mkdir]
if os.name == "posix":
    NO_FILES += [os.mkfifo, lambda path: path.symlink_to("/dev/zero")]
