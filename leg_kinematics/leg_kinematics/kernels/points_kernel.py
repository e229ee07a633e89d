# SPDX-License-Identifier: Apache-2.0
"""Kernels that run over points by themselves and are called with any leading axes in their place.

    @points_kernel("(g),(points,3)->(points)", "f8 f8 f8")
    def height(geometry, feet, heights):
        for i in range(len(feet)):
            heights[i] = feet[i, 2] - geometry[0]

    height(geometry, np.ones((10, 4, 3))).shape    # (10, 4)

Such a kernel can compute several points with one instruction, see `blocks`, and one point costs
little, while numpy takes longer to call a ufunc than most kernels take for a point. The code around
the function, which checks lengths and makes the results, is therefore written for each kernel, as
`dataclasses` writes methods. For the kernel above:

    def call(geometry, feet):
        if feet.ndim != 1:
            return kernel.of_batch(geometry, feet)
        heights = empty(1, f8)
        kernel.of_point(geometry, feet, heights)
        return heights[0]

    def call_points(count, geometry, feet):
        heights = empty((count,), f8)
        kernel.over_points(geometry, feet, heights)
        return heights

    def of_point(geometry, feet, heights):  # compiled
        over_points(geometry, np.expand_dims(feet, 0), heights)

    def checked(geometry, feet, heights):  # compiled: over_points
        if feet.shape[1] != 3:
            raise ValueError("feet ...")
        function(geometry, feet, heights)
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types

from leg_kinematics.arrays import common_batch
from leg_kinematics.kernels.kernel import at_real_path, compile_or_load

POINTS = "points"  # axis of the points in a layout


class Operand(NamedTuple):
    """An input or a result of a kernel.

    Attributes:
        name: Name of the function's parameter.
        number: Name of the numbers' type.
        of_points: Whether it differs from point to point.
        core: Axes of one point: lengths, or names of lengths.
        is_result: Whether the function fills it.
    """

    name: str
    number: str
    of_points: bool
    core: tuple[str, ...]
    is_result: bool

    def numba_type(self, axes: int) -> Any:
        """Return the type of the operand with so many axes; an input may be any array."""
        number = getattr(types, self.number)
        if not axes:
            return number
        if self.is_result:
            return types.Array(number, axes, "A")
        return types.Array(number, axes, "A", readonly=True, aligned=False)


class PointsKernel:
    """What a kernel that runs over points consists of.

    Attributes:
        function: The function that runs over points.
        call: The function that applies it to every point of the broadcast arguments, which must be
            arrays; a ValueError tells that they do not broadcast or do not fit the layout. At its
            first call it compiles, or loads machine code.
    """

    def __init__(self, function: Callable[..., None], layout: str, types: str) -> None:
        self.function = at_real_path(function)
        self._operands = list(_operands(function, layout, types.split()))
        self._inputs = [o for o in self._operands if not o.is_result]
        self._results = [o for o in self._operands if o.is_result]
        # inputs that differ from point to point, and how many axes those of one point have
        self._of_points = [(k, len(o.core)) for k, o in enumerate(self._inputs) if o.of_points]
        self._fold = lru_cache(self._new_fold)
        self.call = self._functions["call"]
        self.call.__doc__ = function.__doc__

    def of_batch(self, *arguments: Any) -> Any:
        """Make all leading axes of the points one, and give the results the same axes back."""
        batch, folded = self._fold(*[argument.shape for argument in arguments])
        inputs = [*arguments]
        for k, leading in folded:
            inputs[k] = _folded(arguments[k], leading, batch)
        results = self._functions["call_points"](math.prod(batch), *inputs)
        if len(batch) == 1:
            return results
        if len(self._results) == 1:
            return results.reshape(batch + results.shape[1:])
        return tuple([result.reshape(batch + result.shape[1:]) for result in results])

    def _new_fold(
        self, *shapes: tuple[int, ...]
    ) -> tuple[tuple[int, ...], list[tuple[int, tuple[int, ...]]]]:
        """Return the axes of a batch and, of each input that has others, its index and axes."""
        leading = {k: shapes[k][: len(shapes[k]) - axes] for k, axes in self._of_points}
        batch = common_batch(leading.values())
        return batch, [(k, a) for k, a in leading.items() if a != batch or len(batch) != 1]

    @cached_property
    def over_points(self) -> Any:
        """The compiled function of points along one axis."""
        signature = [o.numba_type(o.of_points + len(o.core)) for o in self._operands]
        return self._compiled("checked", signature, nogil=True)

    @cached_property
    def of_point(self) -> Any:
        """The compiled function of one point; a result that is a number has an axis of length 1."""
        self._functions["over_points"] = self.over_points
        signature = [o.numba_type(len(o.core) or int(o.is_result)) for o in self._operands]
        return self._compiled("of_point", signature)

    def _compiled(self, name: str, signature: Sequence[Any], **options: Any) -> Any:
        function = self._functions[name]
        function.__qualname__ = f"{self.function.__qualname__}.{name}"

        def compiled(cache: bool) -> Any:
            decorate = numba.njit(
                tuple(signature), cache=cache, error_model="numpy", no_cfunc_wrapper=True, **options
            )
            return decorate(function)

        return compile_or_load(self.function, compiled, name, self._source)

    @cached_property
    def _functions(self) -> dict[str, Any]:
        """What the code around the function defines, by name."""
        names = {
            "__name__": self.function.__module__,
            "kernel": self,
            "function": numba.njit(error_model="numpy", inline="always")(self.function),
            "np": np,
            "empty": np.empty,
            "ndarray": np.ndarray,
            **{o.number: np.dtype(o.number).type for o in self._operands},
        }
        exec(compile(self._source, self.function.__code__.co_filename, "exec"), names)
        return names

    @cached_property
    def _source(self) -> str:
        """The code around the function."""
        inputs, results, operands = map(_listed, (self._inputs, self._results, self._operands))
        batch = [f"{o.name}.ndim != {len(o.core)}" for o in self._inputs if o.of_points]
        numbers = [o.name for o in self._inputs if o.of_points and not o.core]
        first = ", ".join(o.name if o.core else f"{o.name}[0]" for o in self._results)
        blocks = (
            (
                f"def call({inputs}):",
                f"if {' or '.join(batch)}:",
                f"    return kernel.of_batch({inputs})",
                # numba does not take arrays without axes for numbers
                *(f"if type({n}) is ndarray: {n} = {n}[()]" for n in numbers),
                *self._allocations(""),
                f"kernel.of_point({operands})",
                f"return {first}",
            ),
            (
                f"def call_points(count, {inputs}):",
                *self._allocations("count,"),
                f"kernel.over_points({operands})",
                f"return {results}",
            ),
            (
                f"def of_point({operands}):",
                f"over_points({', '.join(map(_as_points, self._operands))})",
            ),
            (
                f"def checked({operands}):",
                *self._checks(),
                f"function({operands})",
            ),
        )
        return "\n\n".join("\n    ".join(block) for block in blocks)

    def _allocations(self, count: str) -> Iterator[str]:
        """Yield the statements that make the results."""
        lengths = {
            axis: f"{o.name}.shape[{k - len(o.core)}]"
            for o in self._inputs
            for k, axis in enumerate(o.core)
        }
        for result in self._results:
            shape = count + "".join(f"{lengths.get(axis, axis)}," for axis in result.core)
            yield f"{result.name} = empty(({shape or 1}), {result.number})"

    def _checks(self) -> Iterator[str]:
        """Yield the statements that refuse operands of wrong lengths."""
        lengths: dict[str, str] = {}
        for operand in self._operands:
            axes = (POINTS, *operand.core) if operand.of_points else operand.core
            for k, axis in enumerate(axes):
                length = f"{operand.name}.shape[{k}]"
                expected = axis if axis.isdecimal() else lengths.setdefault(axis, length)
                if expected != length:
                    yield f"if {length} != {expected}:"
                    yield f"    raise ValueError({f'axis {k} of {operand.name} must be {axis}'!r})"


def _operands(
    function: Callable[..., None], layout: str, numbers: Sequence[str]
) -> Iterator[Operand]:
    """Yield the operands that a layout describes."""
    names = inspect.signature(function).parameters
    inputs = layout.split("->")[0].count("(")
    all_axes = re.findall(r"\(([^)]*)\)", layout)
    for k, (name, axes, number) in enumerate(zip(names, all_axes, numbers, strict=True)):
        core = tuple(axes.split(","))
        of_points = core[0] == POINTS
        yield Operand(name, number, of_points, core[1:] if of_points else core, k >= inputs)


def _listed(operands: Sequence[Operand]) -> str:
    """Return names of operands as they are written in a call."""
    return ", ".join(o.name for o in operands)


def _as_points(operand: Operand) -> str:
    """Return the expression that makes an operand of one point one of points."""
    if operand.of_points and operand.core:
        return f"np.expand_dims({operand.name}, 0)"
    if operand.of_points and not operand.is_result:
        return f"np.full(1, {operand.name}, {operand.number})"
    return operand.name


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


def points_kernel(layout: str, types: str) -> Callable[[Callable[..., None]], Callable[..., Any]]:
    """Make a function that runs over points a kernel, see `PointsKernel.call`.

    Args:
        layout: Layout of inputs and results with "points" as the first axis where they differ from
            point to point, e.g. "(g),(points,3)->(points,n),(points)". Other axes have a length or
            a name, which stands for one length in the whole layout.
        types: numba types of the numbers in the same order, e.g. "f8 f8 f8 u1".
    """
    return lambda function: PointsKernel(function, layout, types).call
