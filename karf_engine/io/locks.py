"""Locks of files between processes, and between computers that share a drive.

The operating system frees its locks when a process ends, however it ends. Where a file system has none (NFS without its
lock service, Lustre, some shares), a lease stands in: a file `<name>.lease` with computer and process, which its holder
renews every `LEASE_SECONDS` / 3. Whoever sees no renewal for `LEASE_SECONDS` takes it over, so a holder that is suspended
for longer, or cut off from the drive, may find another one at work.
"""

from __future__ import annotations

import errno
from pathlib import Path

from filelock import BaseFileLock, FileLock, SoftFileLease, Timeout

LEASE_SECONDS = 15.0
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)


def acquire(path: Path, seconds: float = 0.0) -> BaseFileLock:
    """Acquire a file's lock; call `release` on what is returned.

    Args:
        path: The file, which is made and stays.
        seconds: How long to wait for another holder. A lease takes at least the time after which it would have ended.

    Raises:
        Timeout: Another process holds it.
        OSError: The file cannot be made.
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
