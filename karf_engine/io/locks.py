"""File locks between processes, also on shared drives.

The operating system frees a lock when its process ends. File systems without locks (NFS without its lock service, Lustre,
some shares) use a lease instead: a file `<name>.lease` that its holder renews every `LEASE_SECONDS` / 3. A lease that was
not renewed for `LEASE_SECONDS` can be taken over, also from a holder that was only suspended or disconnected.
"""

from __future__ import annotations

import errno
from pathlib import Path

from filelock import BaseFileLock, FileLock, SoftFileLease, Timeout

LEASE_SECONDS = 15.0
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)


def acquire(path: Path, seconds: float = 0.0) -> BaseFileLock:
    """Acquire a lock; call `release` on the result. The file is created and kept.

    Waits `seconds` for another holder, for a lease at least until it expires. Raises Timeout if another process has the
    lock, OSError if the file cannot be created.
    """
    lock: BaseFileLock = FileLock(path, timeout=seconds, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        raise
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        lease = path.with_name(f"{path.name}.lease")
        lock = SoftFileLease(lease, lease_duration=LEASE_SECONDS, timeout=max(seconds, 1.2 * LEASE_SECONDS))
        lock.acquire()
    return lock
