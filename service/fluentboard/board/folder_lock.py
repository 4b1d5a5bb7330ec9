"""Folder lock: one process at a time writes in a data folder."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from fluentboard.errors import StorageFailed

try:
    import fcntl
except ImportError:  # not on Windows, where the RDF store's own lock has to do
    fcntl = None

logger = logging.getLogger(__name__)

LOCK = "lock"
"""Name of the file in the folder; it holds the number of the process."""


class FolderLock:
    """Held from when it is made until it is closed, or its process ends in whatever way.

    Args:
        folder: what is locked.

    Raises:
        StorageFailed: another process holds it, or the folder is not writable.
    """

    def __init__(self, folder: Path) -> None:
        try:
            self._file = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as problem:
            raise StorageFailed(
                f"cannot write in the data folder {folder}: {problem}; give a writable one with "
                "--data"
            ) from None
        try:
            if fcntl is not None:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(self._file, 20).decode("ascii", "replace").strip()
            os.close(self._file)
            raise StorageFailed(
                f"the data folder {folder} is in use by another fluentboard (process {holder}); "
                "stop that one, or give another folder with --data"
            ) from None
        except OSError as problem:
            # Some network file systems have no locks.
            logger.warning("cannot lock the data folder %s: %s", folder, problem)
        os.truncate(self._file, 0)
        os.write(self._file, b"%d\n" % os.getpid())

    def close(self) -> None:
        """Lets others have the folder. Closing twice is harmless."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
