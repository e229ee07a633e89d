"""Scalar code of one point, compiled and broadcast over all leading axes of a batch.

The mathematics of a point is written once, as scalar Python that reads like the paper:

    @scalar
    def hypotenuse(a, b):
        return math.sqrt(a * a + b * b)

    @kernel("(),()->()", "f8, f8, f8[:]")
    def hypotenuse_kernel(a, b, result):
        result[0] = hypotenuse(a, b)

    hypotenuse_kernel(np.ones(1000), 2.0)   # a numpy generalized ufunc

A kernel that computes many points with one instruction runs over the points by itself. Its layout
names their axis: "(g),(points,n)->(points)"; it is called with any leading axes in place of it.

Scalar code calls other scalar code by its global name; numba cannot cache functions that come as
arguments or in closures. Compiled code is cached between processes. The cache folder of a kernel is
named after a digest of the sources of everything the kernel calls, because numba itself notices
only edits of the file in which the kernel stands.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import inspect
import math
import os
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core.dispatcher import Dispatcher

from leg_kinematics.arrays import common_batch

# numpy's error model: a division by zero yields inf or NaN for that point, never an exception.
scalar = numba.njit(error_model="numpy")
# The same for short code without branches: loops of kernels take it in and compute several points
# with one instruction.
inlined = numba.njit(error_model="numpy", forceinline=True)

POINTS = "points"  # axis of the points in a layout

# C's feclearexcept: a kernel that runs over points ends with it, because NaN marks points without
# an answer; numpy would warn of each.
_clear_float_flags = types.ExternalFunction("feclearexcept", types.int32(types.int32))
_ALL_FLAGS = 0x3F  # C ignores the bits that a processor does not have


@inlined
def ignore_float_errors() -> None:
    """Forget which floating-point errors happened so far."""
    _clear_float_flags(_ALL_FLAGS)


_thread_lock = threading.RLock()


class Kernel:
    """A generalized ufunc that compiles, or loads its cached machine code, at its first call."""

    def __init__(self, function: Callable[..., None], layout: str, types: str) -> None:
        # numba caches by path; linked and installed names of one file shall share what is compiled
        path = os.path.realpath(function.__code__.co_filename)
        function.__code__ = function.__code__.replace(co_filename=path)
        self.function = function
        self.layout = layout
        self.types = types
        self.__doc__ = function.__doc__
        inputs = re.findall(r"\(([^)]*)\)", layout.split("->")[0])
        # inputs that differ from point to point, and how many axes those of one point have
        self._of_points = [
            (k, axes.count(",")) for k, axes in enumerate(inputs) if axes.split(",")[0] == POINTS
        ]

    def __call__(self, *arguments: Any) -> Any:
        """Apply the kernel to every point of the broadcast arguments.

        Raises:
            ValueError: If their leading axes do not broadcast.
        """
        if not self._of_points:
            with np.errstate(all="ignore"):  # NaN marks points without an answer
                return self.gufunc(*arguments)
        folded = list(arguments)
        for k, axes in self._of_points:
            if arguments[k].ndim != axes:
                return self._of_batch(arguments)
            folded[k] = arguments[k][None]
        results = self.gufunc(*folded)
        return tuple([r[0] for r in results]) if isinstance(results, tuple) else results[0]

    def _of_batch(self, arguments: tuple[Any, ...]) -> Any:
        """Make all leading axes of the points one, and give the results the same axes back."""
        folded = list(arguments)
        shapes = [arguments[k].shape[: arguments[k].ndim - axes] for k, axes in self._of_points]
        batch = common_batch(shapes)
        for (k, _), leading in zip(self._of_points, shapes, strict=True):
            if leading != batch or len(batch) > 1:
                folded[k] = _folded(arguments[k], leading, batch)
        results = self.gufunc(*folded)
        if len(batch) == 1:
            return results
        if not isinstance(results, tuple):
            return results.reshape(batch + results.shape[1:])
        return tuple([r.reshape(batch + r.shape[1:]) for r in results])

    @cached_property
    def gufunc(self) -> Any:
        """The compiled generalized ufunc."""
        folder = _cache_folder(self.function)
        with _thread_lock, _process_lock(folder):
            name = f"{self.function.__module__}.{self.function.__qualname__}"
            if folder is None or not any(folder.rglob(f"*.{self.function.__name__}-*.nbi")):
                print(f"compiling {name} for this machine (once)", file=sys.stderr, flush=True)
            decorate = numba.guvectorize(
                [f"({self.types})"], self.layout, nopython=True, cache=folder is not None
            )
            previous = numba.config.CACHE_DIR
            numba.config.CACHE_DIR = str(folder or previous)
            try:
                return decorate(self.function).ufunc  # numpy's, without numba's wrapper
            finally:
                numba.config.CACHE_DIR = previous


def _folded(array: Any, leading: tuple[int, ...], batch: tuple[int, ...]) -> Any:
    """Return an array, broadcast to a batch, with one axis in place of the leading ones."""
    of_point = array.shape[len(leading) :]
    count = math.prod(batch)
    if not leading and count == 1:
        return array[None]
    if not leading and array.flags.c_contiguous:  # what `np.broadcast_to` does, in a tenth the time
        return np.ndarray((count, *of_point), array.dtype, array, strides=(0, *array.strides))
    if leading != batch:
        array = np.broadcast_to(array, batch + of_point)
    return array if len(batch) == 1 else array.reshape(-1, *of_point)


def kernel(layout: str, types: str) -> Callable[[Callable[..., None]], Kernel]:
    """Make a function of one point, or one that runs over points, a generalized ufunc.

    Args:
        layout: Layout of inputs and outputs, e.g. "(n),()->(n)".
        types: numba types of the arguments in the same order, e.g. "f8[:], f8, f8[:]".
    """
    return lambda function: Kernel(function, layout, types)


def _cache_folder(function: Callable[..., None]) -> Path | None:
    """Return a writable folder for the compiled code of `function`, or None without one."""
    roots = [os.environ.get("NUMBA_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME"), "~/.cache"]
    for root in filter(None, roots):
        folder = Path(root).expanduser() / "leg_kernels" / _digest(function)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    warnings.warn("no writable cache folder: kernels compile anew in every process", stacklevel=2)
    return None


@contextlib.contextmanager
def _process_lock(folder: Path | None) -> Iterator[None]:
    """Let one process at a time compile into a folder; the others then load what it compiled.

    Without it, nodes that start together write over each other's files, and numba loads machine
    code under an index that belongs to another compilation.
    """
    if folder is None:
        yield
        return
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # closing the file gives it back
        yield


def _digest(function: Callable[..., None]) -> str:
    """Return a digest of the sources of `function` and of all scalar code it calls."""
    # cached code finds its globals by the name of the module
    origin = [numba.__version__, str(sys.implementation.cache_tag), function.__module__]
    parts = [*origin, *sorted(set(_sources(function, set())))]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _sources(function: Callable[..., Any], seen: set[Any]) -> Iterator[str]:
    """Yield the source of `function`, of its callees and the constants they use."""
    if function in seen:
        return
    seen.add(function)
    yield inspect.getsource(function)
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, Dispatcher):
            yield from _sources(value.py_func, seen)
        elif isinstance(value, (int, float)) and not (
            isinstance(value, float) and math.isnan(value)
        ):
            yield f"{name}={value!r}"
        elif isinstance(value, type):
            yield f"{name}={getattr(value, '_fields', value)!r}"
