"""What a sweep has done, in files that survive it: one journal, or a folder of partitions."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import struct
import uuid
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
import numpy.typing as npt

from ._errors import FileError, UsageError, needed
from ._halfarrow import __version__

Array = npt.NDArray[np.float64]
Columns = list[tuple[str, str, Array]]

ABOUT = "_sweep.json"
"""The file of a folder of partitions that tells which sweep it is. Readers of Parquet leave out what begins like this."""

_KIND = b"halfarrow sweep 1\n"
# What an entry of a journal begins with: bytes of its head, bytes of its columns, and what tells whether they are whole.
_ENTRY = struct.Struct("<QQI")


@dataclasses.dataclass(frozen=True)
class Done:
    """A part of a sweep."""

    first: int
    """How many sets stand before it."""
    sets: int
    columns: Columns
    """Its rows; none where they stand in a file."""
    report: dict[str, Any]


class Kept(Protocol):
    """Where parts of a sweep are kept."""

    def parts(self) -> list[Done]:
        """What is there from before, in the order of the sets."""

    def add(self, part: Done) -> None:
        """Keeps a part that was computed."""

    def close(self) -> None:
        """Lets others have it."""


def identity(parts: Any, arguments: Mapping[str, Any], given: Any, names: list[str], rows: Array) -> dict[str, Any]:
    """What tells one sweep from another: everything that its rows depend on."""
    run = {name: value for name, value in arguments["run"].items() if name not in ("execution", "sensitivities")}
    values = hashlib.sha256(json.dumps(names).encode())
    values.update(np.ascontiguousarray(rows, dtype="<f8").tobytes())
    inputs = hashlib.sha256()
    for name, value in given:
        arrays = isinstance(value, tuple) and isinstance(value[0], np.ndarray)
        told = [np.asarray(part, dtype="<f8").tobytes().hex() for part in value] if arrays else value
        inputs.update(json.dumps([name, told]).encode())
    found: dict[str, Any] = {
        "version": __version__,
        # What its file is called does not matter.
        "model": hashlib.sha256(json.dumps(parts[1:], sort_keys=True).encode()).hexdigest(),
        "sets": len(rows),
        "values": values.hexdigest(),
        "inputs": inputs.hexdigest(),
        "reduce": arguments["reduce"],
        "run": run,
    }
    # As it will be read.
    return dict(json.loads(json.dumps(found)))


_WORDS = {
    "version": "it was written by halfarrow {there}",
    "model": "its model is another one",
    "sets": "it has {there} sets, not {here}",
    "values": "its parameters have other values",
    "inputs": "its inputs are others",
    "reduce": "it keeps {there}, not {here}",
}


def _refused(path: Path, there: Mapping[str, Any], here: Mapping[str, Any]) -> UsageError:
    runs = [
        f"its `{name}` is {there['run'].get(name)!r}, not {value!r}"
        for name, value in here["run"].items()
        if there.get("run") and there["run"].get(name) != value
    ]
    others = [text.format(there=there.get(k), here=here[k]) for k, text in _WORDS.items() if there.get(k) != here[k]]
    if "it has" in " ".join(others):
        others = [text for text in others if text != _WORDS["values"]]
    why = "; ".join([*others, *runs]) or "what is kept of a run has other names"
    return UsageError(f"{path} holds another sweep: {why}. Give another path, or restart=True to give that one up")


class Journal:
    """One file, to whose end every part is written. What was cut in the middle of an entry is taken away."""

    def __init__(self, path: Path, about: Mapping[str, Any], restart: bool) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
            self._file = path.open("r+b")
        except OSError as why:
            raise FileError(f"{path} cannot be written: {why}") from None
        try:
            lock(self._file.fileno(), path)
            if restart:
                self._file.truncate(0)
            self._parts = self._read(about)
        except BaseException:
            self._file.close()
            raise

    def _read(self, about: Mapping[str, Any]) -> list[Done]:
        file = self._file
        begin = file.readline()
        line = file.readline()
        if not begin.endswith(b"\n") and _KIND.startswith(begin) or begin == _KIND and not line.endswith(b"\n"):
            # Nothing, or the beginning of a journal.
            file.seek(0)
            file.truncate()
            file.write(_KIND + json.dumps(about).encode() + b"\n")
            file.flush()
            return []
        if begin != _KIND:
            raise UsageError(f"{self.path} is no journal of a sweep: give another path")
        there = json.loads(line)
        if there != about:
            raise _refused(self.path, there, about)
        parts, end = [], file.tell()
        while (part := _entry(file)) is not None:
            parts.append(part)
            end = file.tell()
        file.seek(end)
        file.truncate()
        return sorted(parts, key=lambda part: part.first)

    def parts(self) -> list[Done]:
        return self._parts

    def add(self, part: Done) -> None:
        columns = [(name, unit) for name, unit, _ in part.columns]
        head = json.dumps({"first": part.first, "sets": part.sets, "columns": columns, "report": part.report}).encode()
        body = b"".join(np.ascontiguousarray(values, dtype="<f8").tobytes() for _, _, values in part.columns)
        try:
            self._file.write(_ENTRY.pack(len(head), len(body), zlib.crc32(body, zlib.crc32(head))) + head + body)
            self._file.flush()
        except OSError as why:
            raise FileError(f"{self.path} cannot be written: {why}") from None

    def close(self) -> None:
        self._file.close()


def _entry(file: IO[bytes]) -> Done | None:
    """The next entry, if it is whole."""
    begin = file.read(_ENTRY.size)
    if len(begin) < _ENTRY.size:
        return None
    heads, bodies, check = _ENTRY.unpack(begin)
    left = os.fstat(file.fileno()).st_size - file.tell()
    if heads + bodies > left:
        return None
    head, body = file.read(heads), file.read(bodies)
    if zlib.crc32(body, zlib.crc32(head)) != check:
        return None
    told = json.loads(head)
    values = np.frombuffer(body, dtype="<f8").astype(np.float64).reshape(len(told["columns"]), -1)
    columns = [(name, unit, values[i]) for i, (name, unit) in enumerate(told["columns"])]
    return Done(told["first"], told["sets"], columns, told["report"])


def lock(file: int, path: Path) -> None:
    """Keeps other sweeps away as long as the file is open; where the system knows no locks there are none."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(
            f"another sweep is writing {path} just now: wait until it is done, or give another path"
        ) from None
    except OSError:
        pass


class Folder:
    """A folder of Parquet files, each written whole by the worker that has computed it."""

    def __init__(self, path: Path, about: Mapping[str, Any], restart: bool, told: Mapping[str, Any]) -> None:
        self.path, self._told = path, {"identity": about, **told}
        arrow()
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._own = os.open(path, os.O_RDONLY) if os.name == "posix" else None
        except OSError as why:
            raise FileError(f"{path} cannot be written: {why}") from None
        try:
            if self._own is not None:
                lock(self._own, path)
            there = about_of(path)
            if restart:
                there = None
                for old in files(path):
                    old.unlink()
            for left in path.glob(".*.partial"):
                with contextlib.suppress(OSError):
                    left.unlink()
            if there is None and files(path):
                raise UsageError(f"{path} has Parquet files of something else: give another folder")
            if there is not None and there.get("identity") != about:
                raise _refused(path, there.get("identity") or {}, about)
            self.tell({"complete": False})
        except BaseException:
            self.close()
            raise

    def tell(self, told: Mapping[str, Any]) -> None:
        """Says what the folder holds."""
        beside = self.path / f".{ABOUT}.{uuid.uuid4().hex}.partial"
        try:
            beside.write_text(json.dumps({**self._told, **told}), encoding="utf-8")
            os.replace(beside, self.path / ABOUT)
        except OSError as why:
            raise FileError(f"{self.path} cannot be written: {why}") from None

    def parts(self) -> list[Done]:
        """What is there. A worker that nobody waited for any more may have written what another has, in other parts."""
        found: list[Done] = []
        for path in files(self.path):
            part = part_of(path)
            if found and part.first < found[-1].first + found[-1].sets:
                path.unlink()
            else:
                found.append(part)
        return found

    def add(self, part: Done) -> None:
        """Its worker has written it."""

    def close(self) -> None:
        if self._own is not None:
            os.close(self._own)
            self._own = None


def about_of(folder: Path) -> dict[str, Any] | None:
    """What a folder says about its sweep, if it is one."""
    try:
        told = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return told if isinstance(told, dict) and "identity" in told else None


def files(folder: Path) -> list[Path]:
    """The partitions, in the order of the sets."""
    return sorted(folder.glob("part-*.parquet"))


def arrow() -> Any:
    """What reads and writes Parquet."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise needed("pyarrow", "parquet", "a sweep into a folder") from None
    return pyarrow


def write_part(folder: Path, part: Done) -> None:
    """Writes a partition whole, or not at all: the number of the set as an integer, `failed` as a truth, all else as doubles.
    Units stand in the metadata as `unit:NAME`, what there is to know of the part as `halfarrow`."""
    pa = arrow()
    kinds = {"set": np.int64, "failed": np.bool_}
    arrays = {name: pa.array(values.astype(kinds.get(name, np.float64))) for name, _, values in part.columns}
    told = {"first": part.first, "sets": part.sets, "report": part.report}
    units = {f"unit:{name}": unit for name, unit, _ in part.columns if unit}
    table = pa.table(arrays).replace_schema_metadata({**units, "halfarrow": json.dumps(told)})
    to = folder / f"part-{part.first:012d}-{part.sets}.parquet"
    beside = folder / f".{to.name}.{uuid.uuid4().hex}.partial"
    try:
        pa.parquet.write_table(table, beside)
        os.replace(beside, to)
    except OSError as why:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise FileError(
            f"{to} cannot be written: {why}; the folder has to be there for every worker, as on a file system that all share"
        ) from None


def part_of(path: Path) -> Done:
    """What a partition says about itself."""
    try:
        told = json.loads(arrow().parquet.read_schema(path).metadata[b"halfarrow"])
    except (OSError, KeyError, TypeError, ValueError) as why:
        raise FileError(f"{path} is no partition of a sweep: {why}") from None
    return Done(told["first"], told["sets"], [], told["report"])


def gaps(parts: Sequence[Done], sets: int) -> list[tuple[int, int]]:
    """What is not there: first set and end of each stretch."""
    found, reached = [], 0
    for part in sorted(parts, key=lambda part: part.first):
        if part.first > reached:
            found.append((reached, part.first))
        reached = max(reached, part.first + part.sets)
    return [*found, (reached, sets)] if reached < sets else found
