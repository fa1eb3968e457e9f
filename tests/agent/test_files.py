"""Files appear whole or not at all, on file systems with and without hard links; none is lost."""

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from keepaway_agent.files import check_writable, moved_into_place, write_whole
from keepaway_agent.texts import MAX_TEXT, one_line


def write(path: Path, text: str, overwrite: bool = False) -> None:
    with moved_into_place(path, overwrite) as file:
        file.write(text.encode())


def failing(number: int) -> Callable[..., None]:
    def fail(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    return fail


@pytest.fixture(params=[None, errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK])
def _file_system(request, monkeypatch):
    """One with hard links, and those that refuse them."""
    if request.param:
        monkeypatch.setattr(Path, "hardlink_to", failing(request.param))


@pytest.mark.usefixtures("_file_system")
def test_a_file_appears_in_its_place_and_is_not_written_over(tmp_path):
    path = tmp_path / "table"
    write(path, "first")
    with pytest.raises(FileExistsError):
        write(path, "second")
    assert path.read_text() == "first"
    write(path, "third", overwrite=True)
    assert path.read_text() == "third"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_moved_is_kept_and_named(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "hardlink_to", failing(errno.EPERM))
    monkeypatch.setattr(Path, "replace", failing(errno.EIO))
    for overwrite in (False, True):
        with pytest.raises(OSError, match="what was written is ") as refused:
            write(tmp_path / "table", "learned", overwrite)
        kept = Path(str(refused.value).rpartition(" is ")[2])
        assert kept.read_text() == "learned"
    assert not (tmp_path / "table").exists()


def test_a_writer_that_fails_leaves_what_was_there(tmp_path):
    path = tmp_path / "table"
    write_whole(path, "first")

    def be_interrupted() -> None:
        with moved_into_place(path, overwrite=True) as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        be_interrupted()
    assert path.read_text() == "first"
    assert list(tmp_path.iterdir()) == [path]


def test_the_longest_name_can_be_written(tmp_path):
    path = tmp_path / ("\N{LATIN SMALL LETTER A WITH DIAERESIS}" * 127)
    write_whole(path, "x")
    assert path.read_text() == "x"


def test_a_folder_that_cannot_be_written_is_known_before(tmp_path):
    check_writable(tmp_path / "new" / "folder")
    assert list((tmp_path / "new" / "folder").iterdir()) == []
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        check_writable(tmp_path / "file" / "folder")


def test_a_line_stays_one_and_stays_the_same():
    for text in ("plain", "a\nb\x1b[31m\u202e\ud800", "\x00" * 100_000, "x" * MAX_TEXT):
        line = one_line(text)
        assert line.isprintable()
        assert len(line) <= MAX_TEXT
        assert one_line(line) == line
