"""Which files a bag has: those that its metadata.yaml lists, in that order; and what is wrong."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from keepaway_sim.bags.mcap_reader import MAGIC
from keepaway_sim.bags.topics import YAML_LOADER
from keepaway_sim.errors import KeepawayError

_LONGEST_METADATA = 2**22  # [bytes]; a file of a bag takes some 200


class BagFiles(NamedTuple):
    """The files of a bag."""

    paths: list[Path]  # in order
    missing: list[str]  # names of files that should be there
    problems: list[str]  # in words, the missing files among them
    message_count: int | None  # as metadata.yaml has it


def bag_files(path: Path) -> BagFiles:
    """Find the files of a bag's folder; a file by itself is one.

    Raises:
        KeepawayError: there is no bag, or it must be unpacked first.
    """
    if path.is_file():
        _refuse_packed(path)
        return BagFiles([path], [], [], None)
    found = sorted(path.glob("*.mcap"), key=_file_number)
    for packed in path.glob("*.mcap.zstd"):
        if packed.with_suffix("") not in found:
            _refuse_packed(packed)
    if not found:
        raise KeepawayError(f"{path}: no bag there (a folder with an .mcap file, or such a file)")
    # A writer that was killed, or found the disk full, may only just have begun its last file.
    begun = [file for file in found if file.stat().st_size >= len(MAGIC)] or found[:1]
    metadata = path / "metadata.yaml"
    if not metadata.is_file():
        return BagFiles(begun, [], ["metadata.yaml is missing"], None)
    return _as_listed(begun, metadata)


def _as_listed(found: list[Path], metadata: Path) -> BagFiles:
    try:
        about = _read_metadata(metadata)
    except KeepawayError as error:
        return BagFiles(found, [], [str(error)], None)
    names = [name.removesuffix(".zstd") for name in about.get("relative_file_paths") or []]
    by_name = {file.name: file for file in found}
    listed = [by_name.pop(name) for name in dict.fromkeys(names) if name in by_name]
    missing = [name for name in names if not (metadata.parent / name).is_file()]
    problems = [f"{name}, which metadata.yaml lists, is missing" for name in missing]
    problems += [f"{name} is not listed by metadata.yaml" for name in by_name]
    return BagFiles([*listed, *by_name.values()], missing, problems, about.get("message_count"))


def _read_metadata(path: Path) -> dict[str, Any]:
    """What a metadata.yaml contains of files.

    Raises:
        KeepawayError: not what rosbag2 writes.
    """
    if path.stat().st_size > _LONGEST_METADATA:
        raise KeepawayError(f"metadata.yaml has {path.stat().st_size:,} bytes: not read")
    try:
        text = path.read_text(encoding="utf-8")
        about = yaml.load(text, Loader=YAML_LOADER)["rosbag2_bagfile_information"]
        files, count = about.get("relative_file_paths") or [], about.get("message_count")
        if not all(isinstance(name, str) and "/" not in name for name in files):
            raise ValueError("names of files")
        if not isinstance(count, int | None):
            raise ValueError("message_count")
        return dict(about)
    except (yaml.YAMLError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as e:
        raise KeepawayError(f"metadata.yaml is not rosbag2's ({type(e).__name__})") from e


def _refuse_packed(path: Path) -> None:
    with path.open("rb") as stream:
        front = stream.read(4)
    if path.suffix == ".zstd" or front == b"\x28\xb5\x2f\xfd":
        raise KeepawayError(f"{path} is packed as a whole: unpack it first, with: unzstd {path}")


def _file_number(path: Path) -> tuple[int, str]:
    number = re.search(r"_(\d{1,9})$", path.stem)
    return int(number[1]) if number else 0, path.name
