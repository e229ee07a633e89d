# SPDX-License-Identifier: Apache-2.0
"""Dimensions of the six-bar leg whose foot follows Theo Jansen's (paper 003, sections 3 and 4).

Both legs share the crank, coupler BC, rocker CD and foot bar CG, so their feet agree where the foot
links stand at the same angle. Five dimensions are free, the vector (7). The paper leaves one:
demanding that the foot link turns back at the same crank angles as Jansen's and swings as far,
equations (15)-(17), every largest angle phi_max fixes a design. The direct search varies all five.

Lengths are in cranks. Vectors of the linkage's plane are complex numbers, so that a product with
exp(i t) turns them by t; angles at a joint are counter-clockwise from the first bar to the second.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, differential_evolution, least_squares

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.errors import GeometryError, ValueRangeError
from leg_kinematics.mechanisms.six_bar import PARTS, WALKING, SixBar
from leg_kinematics.mechanisms.theo_jansen import TheoJansen

SAMPLES = 200  # N of equation (8)
PAPER_PHI_MAX = math.radians(168.0)  # the paper's choice, section 4
SHORTEST, LONGEST, LENGTH_STEPS = 0.02, 14.0, 1400  # where roots of (17) are looked for, in cranks

ComplexArray = NDArray[np.complex128]

JANSEN = TheoJansen(crank_length=1.0)


class Design(NamedTuple):
    """The design vector (7); each field is a number or an array of one shape.

    The rigid links' third sides l_AE and l_FG are given by the angles opposite to them, which also
    tell on which side of the link the third corner lies.

    Attributes:
        pin_spacing: l_BE.
        rod: l_EF.
        foot_lever: l_CF.
        pin_angle: Angle ABE from BA to BE [rad].
        foot_angle: Angle gamma_1 from CF to CG [rad].
    """

    pin_spacing: FloatArray
    rod: FloatArray
    foot_lever: FloatArray
    pin_angle: FloatArray
    foot_angle: FloatArray

    @property
    def rod_crank(self) -> FloatArray:
        """l_AE."""
        return np.abs(1.0 - self.pin_spacing * np.exp(1j * self.pin_angle))

    @property
    def foot_brace(self) -> FloatArray:
        """l_FG."""
        return np.abs(self.foot_lever - JANSEN.foot_bar * np.exp(1j * self.foot_angle))

    @property
    def sides(self) -> FloatArray:
        """How the links are assembled (..., 4), see `leg_kinematics.mechanisms.six_bar`."""
        crank = np.where(np.sin(self.pin_angle) >= 0.0, -1.0, 1.0)
        foot = np.where(np.sin(self.foot_angle) >= 0.0, 1.0, -1.0)
        rocker, rod = np.full_like(crank, WALKING[0]), np.full_like(crank, WALKING[1])
        return np.stack([rocker, rod, crank, foot], axis=-1)

    @property
    def assembly_mode(self) -> str:
        """Name of the mode of `SixBar` in which one design is assembled."""
        parts = [p for p, s, w in zip(PARTS, self.sides, WALKING, strict=True) if s * w < 0.0]
        return f"flipped_{'+'.join(parts)}" if parts else "walking"

    def mechanism(self, crank_length: float = 1.0) -> SixBar:
        """Return one design as a leg.

        Args:
            crank_length: Length of the crank AB [m].

        Raises:
            GeometryError: If it cannot be assembled.
        """
        return SixBar(
            crank_length=crank_length,
            pin_spacing=float(self.pin_spacing),
            rod_crank=float(self.rod_crank),
            rod=float(self.rod),
            foot_lever=float(self.foot_lever),
            foot_brace=float(self.foot_brace),
        )


class Fit(NamedTuple):
    """How well designs follow Jansen's leg; fields have the designs' shape.

    Attributes:
        rms: Root mean square of phi_5 - phi'_5 over a turn [rad], the norm of (8) used here.
        mean_absolute: Mean of |phi_5 - phi'_5| [rad].
        largest_deviation: Largest distance between the feet at equal crank angles [cranks].
    """

    rms: FloatArray
    mean_absolute: FloatArray
    largest_deviation: FloatArray


class LimitPositions(NamedTuple):
    """Where Jansen's foot link turns back relative to the coupler: phi' largest, then smallest.

    Attributes:
        crank_angles: (2,) [rad].
        phi: Angle phi' from CF' to CB (2,) [rad].
        b: Joint B (2,).
        c: Joint C (2,).
        foot_angle: gamma'_1 from CF' to CG [rad].
    """

    crank_angles: FloatArray
    phi: FloatArray
    b: ComplexArray
    c: ComplexArray
    foot_angle: float


class Sweep(NamedTuple):
    """Figure 7: the design of every phi_max and its fit.

    Attributes:
        phi_max: (k,) [rad].
        designs: Designs (k,); NaN where none exists.
        fits: Fits (k,).
    """

    phi_max: FloatArray
    designs: Design
    fits: Fit


class SearchProgress(NamedTuple):
    """Report of a running search.

    Attributes:
        generation: Generations done.
        generations: Largest number of generations.
        rms: Best rms so far [rad].
    """

    generation: int
    generations: int
    rms: float


def jansen_points(crank_angles: ArrayLike) -> dict[str, ComplexArray]:
    """Return the points of Jansen's linkage by name, each of the shape of `crank_angles` [rad]."""
    linkage = JANSEN.linkage(JANSEN.forward(as_array("crank_angles", crank_angles)[..., None]))
    return {
        name: -linkage.points[..., i, 0] + 1j * linkage.points[..., i, 2]
        for i, name in enumerate(linkage.names)
    }


def jansen_phi(crank_angles: ArrayLike) -> FloatArray:
    """Return phi', the angle from CF' to CB in Jansen's linkage (figure 5) [rad]."""
    p = jansen_points(crank_angles)
    return np.angle((p["B"] - p["C"]) / (p["F"] - p["C"])) % (2.0 * np.pi)


def jansen_foot_link(crank_angles: ArrayLike) -> FloatArray:
    """Return phi_5', the angle from the rocker CD to the foot bar CG in Jansen's linkage [rad]."""
    p = jansen_points(crank_angles)
    return np.angle((p["G"] - p["C"]) / (p["D"] - p["C"])) % (2.0 * np.pi)


def limit_positions() -> LimitPositions:
    """Return where Jansen's phi' is largest and smallest (figure 6).

    B, C, D, U, L and F form a figure whose shape depends on the distance BD alone; it is least and
    largest where B lies on the line AD, and there phi' is stationary.
    """
    angles = JANSEN.frame_angle + np.array([0.0, np.pi])
    p, phi = jansen_points(angles), jansen_phi(angles)
    order = np.argsort(-phi)
    foot_angle = float(np.angle((p["G"][0] - p["C"][0]) / (p["F"][0] - p["C"][0])))
    return LimitPositions(
        angles[order] % (2.0 * np.pi), phi[order], p["B"][order], p["C"][order], foot_angle
    )


def synthesize(phi_max: float) -> Design:
    """Return the paper's design for the largest angle phi between CF and CB: (11), (12), (15)-(17).

    At phi_max crank and rod of the four-bar BEFC are stretched, at phi_min folded, so that
    l_EF ± l_BE = |BF|, which (16) tells from l_CF. Equation (17), |AE_1| = |AE_2|, has two roots
    l_CF; in one of them the two E are mirror images, which no rigid crank joins. The root kept has
    the same angle ABE in both positions.

    Args:
        phi_max: Largest angle from CF to CB [rad], between the swing (77.7°) and 180°.

    Raises:
        ValueRangeError: If phi_max is not between the swing and 180°.
        GeometryError: If no crank and rocker fulfil the equations.
    """
    limits = limit_positions()
    swing = float(limits.phi[0] - limits.phi[1])  # (15)
    if not swing < phi_max <= math.pi:
        raise ValueRangeError(
            f"phi_max must be > {math.degrees(swing):.2f}° and <= 180°, "
            f"got {math.degrees(phi_max):.2f}°"
        )
    phi = np.array([phi_max, phi_max - swing])

    def mismatch(foot_lever: ArrayLike) -> FloatArray:
        _, _, pin_angles = _crank_and_rod(limits, phi, np.asarray(foot_lever))
        return np.angle(np.exp(1j * (pin_angles[..., 0] - pin_angles[..., 1])))

    trial = np.linspace(SHORTEST, LONGEST, LENGTH_STEPS)
    found = mismatch(trial)
    roots = np.flatnonzero((found[:-1] * found[1:] <= 0.0) & (np.abs(np.diff(found)) < 1.0))
    for i in roots:
        lever = brentq(mismatch, trial[i], trial[i + 1], xtol=1e-15, rtol=1e-15)
        pin, rod, pin_angles = _crank_and_rod(limits, phi, np.asarray(lever))
        turns = pin + rod < JANSEN.lower_coupler + lever  # (9)
        turns &= pin < min(rod, JANSEN.lower_coupler, lever)  # (10)
        if turns:
            foot_angle = limits.foot_angle - (limits.phi[0] - phi_max)  # (12) and (14)
            angles = (pin_angles[0], np.angle(np.exp(1j * foot_angle)))
            return Design(*map(np.asarray, (pin, rod, lever, *angles)))
    raise GeometryError(f"no crank and rocker BEFC for phi_max = {math.degrees(phi_max):.2f}°")


def _crank_and_rod(
    limits: LimitPositions, phi: FloatArray, foot_lever: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return l_BE, l_EF and the angles ABE (..., 2) of both limit positions: (16)."""
    towards_b = (limits.b - limits.c) / np.abs(limits.b - limits.c)
    bf = limits.c + foot_lever[..., None] * towards_b * np.exp(-1j * phi) - limits.b
    stretched, folded = np.abs(bf[..., 0]), np.abs(bf[..., 1])
    pin, rod = 0.5 * (stretched - folded), 0.5 * (stretched + folded)
    be = np.array([1.0, -1.0]) * bf  # folded, E lies beyond B
    return pin, rod, np.angle(be / -limits.b)


def angle_deviations(designs: Design, samples: int = SAMPLES) -> FloatArray:
    """Return phi_5 - phi'_5 of designs (...) over one turn (..., samples) [rad].

    NaN where a design does not close.
    """
    crank_angles = np.arange(samples) * (2.0 * np.pi / samples)
    jansen = jansen_points(crank_angles)
    foot = _feet(designs, crank_angles)
    return np.angle((foot - jansen["C"]) / (jansen["G"] - jansen["C"]))


def _feet(designs: Design, crank_angles: FloatArray) -> ComplexArray:
    """Return the feet of designs (...) at all crank angles (k,): (..., k)."""
    j = JANSEN
    geometry = np.stack(
        np.broadcast_arrays(
            *(1.0, 0.0, j.frame_length, j.frame_angle, j.lower_coupler, j.lower_rocker),
            *(designs.pin_spacing, designs.rod_crank, designs.rod, designs.foot_lever),
            *(j.foot_bar, designs.foot_brace, 1.0),
        ),
        axis=-1,
    )
    constants = SixBar.kernels.constants(geometry)
    foot = SixBar.kernels.foot_in_plane(
        constants[..., None, :], designs.sides[..., None, :], crank_angles
    )
    return foot[..., 0] + 1j * foot[..., 1]


def fit(designs: Design, samples: int = SAMPLES) -> Fit:
    """Return how well designs (...) follow Jansen's leg; NaN for one that does not close."""
    deviation = np.abs(angle_deviations(designs, samples))
    return Fit(
        np.sqrt(np.mean(deviation**2, axis=-1)),
        np.mean(deviation, axis=-1),
        np.max(2.0 * JANSEN.foot_bar * np.sin(0.5 * deviation), axis=-1),
    )


def sweep(phi_max: ArrayLike, samples: int = SAMPLES) -> Sweep:
    """Return the paper's designs for several phi_max (k,) [rad] and their fits (figure 7)."""
    angles = np.atleast_1d(as_array("phi_max", phi_max))
    rows = np.full((len(angles), len(Design._fields)), np.nan)
    for row, angle in zip(rows, angles, strict=True):
        try:
            row[:] = synthesize(float(angle))
        except GeometryError:
            continue
    designs = Design(*rows.T)
    return Sweep(angles, designs, fit(designs, samples))


# Bounds of the direct search, in the order of `Design`: lengths in cranks, angles in rad.
SEARCH_BOUNDS = (
    *((0.2, 3.0), (2.0, 9.0), (1.0, 5.0)),
    *((math.radians(100.0), math.radians(260.0)), (math.radians(-220.0), math.radians(-60.0))),
)


def search(
    seed: int = 0,
    generations: int = 300,
    population: int = 12,
    callback: Callable[[SearchProgress], bool | None] | None = None,
) -> Design:
    """Search all five dimensions for the least rms of phi_5 - phi'_5.

    Differential evolution, then least squares from its best design.

    Args:
        seed: Seed of the random numbers; equal seeds give equal designs.
        generations: Largest number of generations.
        population: Designs of a generation for each of the five variables.
        callback: Called after every generation; the search stops early if it returns True.

    Raises:
        ValueRangeError: If `generations` or `population` is too small.
    """
    if generations < 1 or population < 5:
        raise ValueRangeError(
            f"generations must be >= 1 and population >= 5, got {generations} and {population}"
        )
    done = 0

    def rms(x: FloatArray) -> FloatArray:
        return np.nan_to_num(fit(Design(*x)).rms, nan=math.pi)

    def report(x: FloatArray, convergence: float) -> bool:
        nonlocal done
        done += 1
        best = float(rms(x))
        return bool(callback and callback(SearchProgress(done, generations, best)))

    def deviations(x: FloatArray) -> FloatArray:
        return np.nan_to_num(angle_deviations(Design(*x)), nan=math.pi)

    found = differential_evolution(
        rms,
        SEARCH_BOUNDS,
        seed=np.random.default_rng(seed),
        maxiter=generations,
        popsize=population,
        vectorized=True,
        updating="deferred",
        polish=False,
        tol=1e-6,
        callback=report,
    )
    lower, upper = np.transpose(SEARCH_BOUNDS)
    polished = least_squares(deviations, found.x, bounds=(lower, upper), xtol=1e-12, ftol=1e-12)
    best = polished.x if rms(polished.x) <= found.fun else found.x
    return Design(*map(np.asarray, best))
