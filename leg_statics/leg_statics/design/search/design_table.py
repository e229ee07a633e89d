# SPDX-License-Identifier: Apache-2.0
"""A table of designs on disk that only grows: a CSV file that survives whatever ends the program.

A line is written in one go as soon as a design is evaluated. The last line may be torn by a kill or
a full disk; it is dropped when the table is opened again. Numbers are written so that reading gives
the same bits.
"""

from __future__ import annotations

import csv
import fcntl
import io
import os
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import LegError

LONGEST_LINE = 1 << 16  # bytes


class TableError(LegError):
    """A table of designs cannot be read or written."""


class Design(NamedTuple):
    """One line of a table.

    Attributes:
        parameters: The dimensions that vary (P,) [SI].
        values: Metrics of the design (K,) [SI]; NaN where there is none.
        error: Relative error to which its means are known.
        problem: Why the design is not feasible; "" if it is.
    """

    parameters: FloatArray
    values: FloatArray
    error: float
    problem: str

    @property
    def feasible(self) -> bool:
        """Whether nothing is wrong with it."""
        return not self.problem


class DesignTable:
    """A table of designs, open for appending by this process alone.

    Args:
        path: The CSV file; made if it does not exist.
        parameters: Names of the dimensions.
        metrics: Names of the metrics.

    Raises:
        TableError: If the file cannot be used, has other columns, or is in use elsewhere.
    """

    def __init__(self, path: Path, parameters: Sequence[str], metrics: Sequence[str]) -> None:
        self.path = path
        self._parameters, self._metrics = tuple(parameters), tuple(metrics)
        try:
            self._file = path.open("ab+", buffering=0)
        except OSError as error:
            raise TableError(f"{path}: cannot be written: {error.strerror}") from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise TableError(f"{path}: another search is at work on it") from None
        try:
            self._drop_torn_line()
            if not self._size:
                self._write(_line(self._header))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> DesignTable:
        """Return the table; leaving the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the table."""
        self.close()

    def close(self) -> None:
        """Let others use the table."""
        self._file.close()

    def append(self, design: Design) -> None:
        """Write a design.

        Raises:
            TableError: If it cannot be written, for instance because the disk is full; what was
                written before is kept.
        """
        numbers = [*design.parameters, *design.values, design.error]
        self._write(_line([*(repr(float(x)) for x in numbers), " ".join(design.problem.split())]))

    def read(self) -> Iterator[Design]:
        """Yield the designs that are in the table now.

        Raises:
            TableError: If a line is not what this class writes.
        """
        end, count = self._size, len(self._parameters)
        with self.path.open("rb") as file:
            lines = iter(partial(file.readline, LONGEST_LINE), b"")
            for number, line in enumerate(lines, start=1):
                fields = next(csv.reader([line.decode("utf-8", "replace")]), [])
                try:
                    if number == 1:
                        self._check_header(fields)
                    else:
                        *numbers, problem = fields
                        x = np.array(numbers, dtype=np.float64)
                        if len(x) != len(self._header) - 1:
                            raise ValueError(f"{len(fields)} fields, not {len(self._header)}")
                        yield Design(x[:count], x[count:-1], float(x[-1]), problem)
                except ValueError as error:
                    raise TableError(f"{self.path}:{number}: damaged: {error}") from None
                if file.tell() >= end:
                    return

    @property
    def _header(self) -> tuple[str, ...]:
        return (*self._parameters, *self._metrics, "error", "problem")

    def _check_header(self, fields: Sequence[str]) -> None:
        if tuple(fields) != self._header:
            raise TableError(
                f"{self.path}: has the columns {', '.join(fields)}; this search writes "
                f"{', '.join(self._header)}"
            )

    def _drop_torn_line(self) -> None:
        size = os.fstat(self._file.fileno()).st_size
        self._file.seek(max(0, size - LONGEST_LINE))
        tail = self._file.read(LONGEST_LINE)
        if size > len(tail) and b"\n" not in tail:
            raise TableError(
                f"{self.path}: damaged: its last line has more than {LONGEST_LINE} bytes"
            )
        self._size = size - len(tail) + tail.rfind(b"\n") + 1
        self._file.truncate(self._size)

    def _write(self, line: bytes) -> None:
        rest = line
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self._file.truncate(self._size)
            raise TableError(
                f"{self.path}: cannot be written: {error.strerror}; what was found before is kept"
            ) from None
        self._size += len(line)


def _line(fields: Sequence[str]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(fields)
    return text.getvalue().encode()
