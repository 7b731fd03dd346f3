"""What is known of a file that was opened: size, time, and the digest of its content."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from emacm._checks import located
from emacm.recordings.digests import digest_of_file


class FileState:
    """Size, time and content of a file when it was opened, and checks that it is still the same.

    The digest is computed when the file is first read, or when a recording in it is pickled.

    Parameters
    ----------
    path : str
        The file.
    size : int
        Its size [bytes].
    written : int
        Time of its last change [ns].
    digest : str
        SHA-256 of its content; "" if it is not known yet.
    inode : tuple of int
        Inode of the file, and time of its last change [ns]; empty on another computer.
    """

    __slots__ = ("_digest", "_inode", "path", "size", "written")

    def __init__(
        self, path: str, size: int, written: int, digest: str = "", inode: tuple[int, ...] = ()
    ) -> None:
        self.path, self.size, self.written = path, size, written
        self._digest, self._inode = digest, inode

    @classmethod
    def of(cls, path: Path) -> FileState:
        """Return the present state of a file.

        Raises
        ------
        FileNotFoundError
            If there is none.
        """
        try:
            status = os.stat(path)
        except FileNotFoundError as error:
            raise FileNotFoundError(f"there is no file {str(path)!r}.") from error
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise OSError(
                f"{str(path)!r} cannot be opened: {reason}. Correct the path or the link."
            ) from error
        inode = status.st_ino, status.st_ctime_ns
        return cls(str(path), status.st_size, status.st_mtime_ns, inode=inode)

    @property
    def key(self) -> tuple[Any, ...]:
        """What tells one content of the file from another in this process."""
        return self.path, self.size, self.written, self._inode or self._digest

    def check_stamp(self) -> None:
        """Raise a ValueError if size or time of the file have changed."""
        with located(self.path):
            found = FileState.of(Path(self.path))
            if (found.size, found.written) != (self.size, self.written):
                raise ValueError(
                    f"the file was replaced or changed since it was opened: it had {self.size} "
                    f"bytes, written at {self.written} ns, and has {found.size} bytes, written at "
                    f"{found.written} ns. Open it again."
                )

    def check_content(self) -> None:
        """Raise a ValueError if the content of the file has changed since it was first known."""
        self.check_stamp()
        with located(self.path):
            found = digest_of_file(self.path)
            if not self._digest:
                self._digest = found
            elif found != self._digest:
                raise ValueError(
                    f"the file was replaced or changed since it was opened: it has the same size "
                    f"and time, but its content had the digest {self._digest[:12]}, and has "
                    f"{found[:12]}. Open it again."
                )

    def __reduce__(self) -> tuple[type[FileState], tuple[str, int, int, str]]:
        """Return path, size, time and digest; of a file that has not been read, it is read now."""
        if not self._digest:
            try:
                self.check_content()
            except (OSError, ValueError):  # found again, and reported, where samples are needed
                self._digest = ""
        return FileState, (self.path, self.size, self.written, self._digest)
