"""Mueller matrix polarimeters: a polarisation state generator before the sample and an analyser behind it.

The reading of state j is I_j = a_j · M g_j with the analyser vector a_j and the Stokes vector g_j that falls on the
sample: linear in the 16 elements of M, whose least-squares solution is m = B⁺ I with the rows a_j ⊗ g_j of B. Sixteen
states or more whose rows are independent determine M.

The usual instrument turns two retarders, one behind a fixed polariser and one before a fixed analyser, at 5 times the
angle of the first (Azzam, Optics Letters 2, 148 (1978)); for others see Chipman, Lam, Young, *Polarized Light and
Optical Systems* (2018), ch. 7. Each of the two has its own axes x, y, both transverse to its own ray and right-handed
with the direction of propagation: angles turn from x towards y, **counterclockwise for an observer who looks against
the light**: at the generator from the sample towards the source, at the analyser from the detector towards the sample.
V > 0 is left circular, as everywhere. Without a sample the two axes are the same, and M is the unit matrix.

Units: the generator's light has the intensity 1 on the sample and the analyser vectors those of ideal elements (½ for
natural light), so that M is in digital numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter
from pbrdf.optics.elements import diattenuator, retarder, rotate_frame

__all__ = ["Generator", "dual_rotating_retarder", "mueller_to_surface_axes", "solve_mueller"]

#: Singular values of the readings' matrix below this share of the largest determine nothing.
_RANK = 1e-6


@dataclass(frozen=True, eq=False)
class Generator:
    """Polarised light on the sample, another in each state.

    Attributes
    ----------
    stokes
        Of intensity 1, in the generator's axes, shape (N, 4).
    reference_angle
        Radians from the p direction of the incident ray to the generator's x axis, from p towards s.
    settings
        What it and its analyser were made from, as the table ``[polarimeter]`` of a file has it; angles in degrees.
    """

    stokes: np.ndarray
    reference_angle: float = 0.0
    settings: Mapping[str, Any] = field(default_factory=dict)


def dual_rotating_retarder(
    generator_angles: ArrayLike,
    analyzer_angles: ArrayLike,
    *,
    generator_retardance: float = np.pi / 2,
    analyzer_retardance: float = np.pi / 2,
    polarizer: float = 0.0,
    analyzer: float = 0.0,
    diattenuation: float = 1.0,
    states: Sequence[str] | None = None,
) -> tuple[Polarimeter, Generator]:
    """Two turning retarders between a polariser and an analyser.

    Parameters
    ----------
    generator_angles, analyzer_angles
        Fast axes of the two retarders in each state, radians, shape (N,).
    generator_retardance, analyzer_retardance
        Radians.
    polarizer, analyzer
        Axes of the polariser before the first retarder and of the analyser behind the second, radians.
    diattenuation
        Of both.
    states
        Names; the two angles in degrees by default, such as 5_25.

    Returns
    -------
    Polarimeter, Generator
        The analyser behind the sample, and the generator before it.

    Raises
    ------
    DataError
        If the angles are not as many.
    """
    first, second = (np.atleast_1d(np.asarray(a, dtype=float)) for a in (generator_angles, analyzer_angles))
    if first.shape != second.shape or first.ndim != 1:
        raise DataError(
            f"{first.size} angles of the generator and {second.size} of the analyser: give as many of each"
        )
    light = diattenuator(polarizer, diattenuation)[:, 0]
    stokes = retarder(first, generator_retardance) @ (light / light[0])
    vectors = diattenuator(analyzer, diattenuation)[0] @ retarder(second, analyzer_retardance)
    names = tuple(states) if states is not None else _names(first, second)
    settings = {
        "kind": "dual_rotating_retarder",
        "angles": np.round(np.rad2deg(np.stack([first, second], axis=1)), 10).tolist(),
        **{
            name: round(float(np.rad2deg(value)), 10)
            for name, value in (
                ("generator_retardance", generator_retardance),
                ("analyzer_retardance", analyzer_retardance),
                ("polarizer", polarizer),
                ("analyzer", analyzer),
            )
        },
        "diattenuation": float(diattenuation),
    }
    polarimeter = Polarimeter(vectors, names, "dual rotating retarder", details={"kind": "measured"})
    return polarimeter, Generator(stokes, settings=settings)


def _names(first: np.ndarray, second: np.ndarray) -> tuple[str, ...]:
    """The two angles in degrees, repeated pairs told apart by a number."""
    pairs = np.round(np.rad2deg(np.stack([first, second], axis=1)), 4).tolist()
    names = [f"{g:g}_{a:g}" for g, a in pairs]
    return tuple(n if names.count(n) == 1 else f"{n}#{names[: i + 1].count(n)}" for i, n in enumerate(names))


def solve_mueller(
    readings: np.ndarray, variance: np.ndarray | None, generator: np.ndarray, analyzer: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The Mueller matrix of each set of readings, all states weighing alike.

    Parameters
    ----------
    readings
        Intensities, shape (..., N).
    variance
        Theirs, the same shape; None: from the residuals, NaN with 16 states.
    generator, analyzer
        Stokes vectors on the sample and analyser vectors, shape (N, 4) each.

    Returns
    -------
    mueller, covariance
        Shapes (..., 4, 4) and (..., 16, 16), elements row by row.
    residual
        Rms of the readings minus those of the matrix, over the mean reading, shape (...).

    Raises
    ------
    DataError
        If the states do not determine the matrix: says how many of its 16 elements.
    """
    rows = (analyzer[:, :, None] * generator[:, None, :]).reshape(len(analyzer), 16)
    singular = np.linalg.svd(rows, compute_uv=False)
    rank = int((singular > _RANK * singular[0]).sum())
    if rank < 16:
        raise DataError(
            f"{len(rows)} pairs of generator and analyser states determine {rank} of the 16 combinations of elements "
            "of a Mueller matrix: add other pairs of angles (5 : 1 in steps of 6° does it), and check the retardances"
        )
    inverse = np.linalg.pinv(rows)
    elements = readings @ inverse.T
    rest = readings - elements @ rows.T
    squares = (rest**2).sum(axis=-1)
    if variance is None:
        freedom = len(rows) - 16
        one = squares / freedom if freedom else np.full(squares.shape, np.nan)
        variance = np.broadcast_to(one[..., None], readings.shape)
    covariance = np.einsum("ij,...j,kj->...ik", inverse, variance, inverse)
    with np.errstate(divide="ignore", invalid="ignore"):
        residual = np.sqrt(squares / len(rows)) / np.abs(readings.mean(axis=-1))
    return elements.reshape(*elements.shape[:-1], 4, 4), covariance, residual


def mueller_to_surface_axes(
    mueller: np.ndarray, covariance: np.ndarray, generator_angle: ArrayLike, analyzer_angle: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Mueller matrices from the axes of the instrument into (p, s) of the incident and the reflected ray.

    Parameters
    ----------
    mueller, covariance
        Shapes (..., 4, 4) and (..., 16, 16).
    generator_angle, analyzer_angle
        Radians from p to the x axes of generator and analyser, from p towards s, shape (...) or numbers.
    """
    left = rotate_frame(-np.asarray(analyzer_angle, dtype=float))
    right = rotate_frame(np.asarray(generator_angle, dtype=float))
    # the elements row by row: M' = L M R is (L ⊗ Rᵀ) m
    both = np.einsum("...ia,...bj->...ijab", left, right).reshape(
        *np.broadcast(left, right).shape[:-2], 16, 16
    )
    return left @ mueller @ right, both @ covariance @ np.swapaxes(both, -1, -2)
