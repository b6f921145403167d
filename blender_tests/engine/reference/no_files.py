"""What can lie in the place of a file and is none: each makes it at a path. Windows has folders alone."""

import os

NO_FILES = [os.mkdir]
if os.name == "posix":
    NO_FILES += [os.mkfifo, lambda path: path.symlink_to("/dev/zero")]
