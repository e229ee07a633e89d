# SPDX-License-Identifier: Apache-2.0
"""Scalar code of one point, compiled and broadcast over all leading axes of a batch.

The mathematics of a point is written once, as scalar Python that reads like the paper:

    @scalar
    def hypotenuse(a, b):
        return math.sqrt(a * a + b * b)

    @kernel("(),()->()", "f8, f8, f8[:]")
    def hypotenuse_kernel(a, b, result):
        result[0] = hypotenuse(a, b)

    hypotenuse_kernel(np.ones(1000), 2.0)   # a numpy generalized ufunc

What computes many points with one instruction is a `points_kernel`.

Scalar code calls other scalar code by its global name; numba cannot cache functions that come as
arguments or in closures. Compiled code is cached between processes. The cache folder of a kernel is
named after a digest of the code of everything the kernel calls, because numba itself notices only
edits of the file in which the kernel stands.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from functools import cached_property
from types import CodeType, FunctionType
from typing import Any

import numba
import numpy as np
from numba.extending import register_jitable

from leg_kinematics.kernels.cache import cache_folder, process_lock

# To Python such functions are what they were; kernels compile them without what a call from Python
# would need, which takes as long again. numpy's error model: in a kernel a division by zero yields
# inf or NaN for that point, never an exception.
scalar = register_jitable(error_model="numpy", no_cfunc_wrapper=True)
# The same for short code without branches: loops of kernels take it in and compute several points
# with one instruction.
inlined = register_jitable(error_model="numpy", no_cfunc_wrapper=True, forceinline=True)

_thread_lock = threading.RLock()


class Kernel:
    """A generalized ufunc that compiles, or loads its cached machine code, at its first call."""

    def __init__(self, function: Callable[..., None], layout: str, types: str) -> None:
        self.function = at_real_path(function)
        self.layout = layout
        self.types = types
        self.__doc__ = function.__doc__

    def __call__(self, *arguments: Any) -> Any:
        """Apply the kernel to every point of the broadcast arguments.

        Raises:
            ValueError: If their leading axes do not broadcast.
        """
        with np.errstate(all="ignore"):  # NaN marks points without an answer
            return self._ufunc(*arguments)

    @cached_property
    def _ufunc(self) -> Any:
        def compiled(cache: bool) -> Any:
            decorate = numba.guvectorize(
                [f"({self.types})"], self.layout, nopython=True, cache=cache
            )
            return decorate(self.function).ufunc  # numpy's, without numba's wrapper

        return compile_or_load(self.function, compiled)


def at_real_path(function: Callable[..., None]) -> Callable[..., None]:
    """Return the function, known by the real path of its file: numba caches by path.

    Linked and installed names of one file then share what is compiled.
    """
    path = os.path.realpath(function.__code__.co_filename)
    function.__code__ = function.__code__.replace(co_filename=path)
    return function


def compile_or_load(
    function: Callable[..., None],
    compiled: Callable[[bool], Any],
    name: str = "",
    source: str = "",
) -> Any:
    """Return what `compiled` makes, with a folder for numba's cache if it is told to use one.

    Args:
        function: The kernel's function.
        compiled: Compiles it, or loads it from the cache.
        name: Name of the function that is compiled, if it is one around the kernel's.
        source: Source of that function.
    """
    folder = cache_folder(_digest(function, source))
    with _thread_lock, process_lock(folder):
        if folder is None or not any(folder.rglob(f"*{name or function.__name__}-*.nbi")):
            what = ".".join(filter(None, (function.__module__, function.__qualname__, name)))
            print(f"compiling {what} for this machine (once)", file=sys.stderr, flush=True)
        previous = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder or previous)
        try:
            return compiled(folder is not None)
        finally:
            numba.config.CACHE_DIR = previous


def kernel(layout: str, types: str) -> Callable[[Callable[..., None]], Kernel]:
    """Make a function of one point a generalized ufunc.

    Args:
        layout: Layout of inputs and outputs, e.g. "(n),()->(n)".
        types: numba types of the arguments in the same order, e.g. "f8[:], f8, f8[:]".
    """
    return lambda function: Kernel(function, layout, types)


def _digest(function: Callable[..., None], source: str) -> str:
    """Return a digest of `function`, of all scalar code it calls and of the source around it."""
    # cached code finds its globals by the name of the module
    origin = [numba.__version__, str(sys.implementation.cache_tag), function.__module__]
    parts = [*origin, source, *sorted(set(_meanings(function, set())))]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _meanings(function: Callable[..., Any], seen: set[Any]) -> Iterator[str]:
    """Yield the bytecode of `function` and of its callees, and the constants that they use.

    The sources would tell as much, but take a hundred times as long to find.
    """
    if function in seen:
        return
    seen.add(function)
    cells = (cell.cell_contents for cell in function.__closure__ or ())
    known = {**function.__globals__, **dict(zip(function.__code__.co_freevars, cells, strict=True))}
    for code in _codes(function.__code__):
        constants = [c for c in code.co_consts if not isinstance(c, CodeType)]
        yield repr((code.co_code, code.co_names, code.co_varnames, code.co_freevars, constants))
        for name in code.co_names + code.co_freevars:
            value = known.get(name)
            if isinstance(value, FunctionType):
                yield from _meanings(value, seen)
            elif isinstance(value, (int, float)) and value == value:  # no NaN
                yield f"{name}={value!r}"
            elif isinstance(value, type):
                yield f"{name}={getattr(value, '_fields', value)!r}"


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and those within it, such as of comprehensions."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)
