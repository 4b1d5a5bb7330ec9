"""Two processes on one data folder."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fluentboard.board.blackboard import Blackboard
from fluentboard.board.folder_lock import LOCK, FolderLock
from fluentboard.errors import StorageFailed


def test_a_folder_in_use_is_refused_and_the_holder_named(tmp_path: Path) -> None:
    held = FolderLock(tmp_path)
    with pytest.raises(StorageFailed, match=rf"in use by another .*process {os.getpid()}\)"):
        FolderLock(tmp_path)
    held.close()
    FolderLock(tmp_path).close()


def test_a_second_board_is_refused_whatever_store_it_has(tmp_path: Path) -> None:
    with (
        Blackboard.open(tmp_path, builtin_ontologies=False),
        pytest.raises(StorageFailed, match="stop that one"),
    ):
        Blackboard.open(tmp_path)
    Blackboard.open(tmp_path, builtin_ontologies=False).close()


def test_a_folder_that_takes_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / LOCK).mkdir()
    with pytest.raises(StorageFailed, match="cannot write in the data folder"):
        FolderLock(tmp_path)
