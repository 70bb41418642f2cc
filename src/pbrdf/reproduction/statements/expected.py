"""Numbers worked out from the paper's equations beforehand, beside those of the model.

They are a check of the model and of the interpretations, not of the paper, which prints none of them. Those "of a flat
coating" let body light leave through a level surface (σ → 0 in D_v); at the paper's σ the facets move them a
little, which the text says where it shows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pbrdf.models import Model
from pbrdf.optics.stokes import dolp
from pbrdf.reproduction.interpretations import INTERPRETATIONS, Interpretation
from pbrdf.reproduction.paper import FIGURE_3_INCIDENCE
from pbrdf.reproduction.plane import in_plane, offsets, turned, zero_crossings
from pbrdf.reproduction.statements.intensity import DIFFUSE_AT
from pbrdf.reproduction.statements.polarisation import figure_3_cut, ten_per_cent_angles

__all__ = ["Number", "expected_numbers"]

#: Roughness at which the coating is as good as flat.
_FLAT = 0.001
_BISTATIC = np.deg2rad([30.0, 50.0, 70.0, 90.0])


@dataclass(frozen=True)
class Number:
    """One row of the comparison.

    Attributes
    ----------
    statement
        Number of the statement that it belongs to.
    quantity
        What it is, with its unit.
    interpretation
        Name of the interpretation of the equations.
    expected, tolerance, found
        Expected and found numbers of the same length.
    """

    statement: int
    quantity: str
    interpretation: str
    expected: tuple[float, ...]
    tolerance: float
    found: tuple[float, ...]

    @property
    def within(self) -> bool:
        """Whether every number is within the tolerance; a NaN is met by a NaN."""
        return bool(
            np.allclose(self.found, self.expected, rtol=0.0, atol=self.tolerance * (1 + 1e-9), equal_nan=True)
        )


def expected_numbers() -> list[Number]:
    """All numbers, by statement."""
    rows = [
        *_diffuse_dop(),
        *_figure_3(),
        *_peaks(),
        *_diffuse_ratios(),
        *_maxima(),
        *_zeros(),
        *_equal_view(),
    ]
    return sorted(rows, key=lambda row: row.statement)


def _number(
    statement: int,
    quantity: str,
    interpretation: Interpretation,
    expected: Sequence[float],
    tolerance: float,
    found: Sequence[float] | np.ndarray,
) -> Number:
    return Number(
        statement, quantity, interpretation.name, tuple(expected), tolerance, tuple(map(float, found))
    )


def _diffuse_dop() -> Iterator[Number]:
    default, amplitude = INTERPRETATIONS[0], INTERPRETATIONS[1]
    yield _number(
        1,
        "θr (°) where the diffuse light of samples 1 … 5 is 10 % polarised",
        default,
        (62.0, 66.0, 66.0, np.nan, 72.0),
        1.0,
        ten_per_cent_angles(default.samples()),
    )
    theta_r = np.deg2rad([30.0, 45.0, 60.0, 70.0, 80.0])
    for interpretation, expected in (
        (default, (1.5, 3.7, 7.8, 12.0, 16.3)),
        (amplitude, (1.7, 4.5, 10.1, 16.6, 26.7)),
    ):
        flat = interpretation.sample(3).replace(sigma=_FLAT)
        found = 100.0 * dolp(in_plane(flat, np.deg2rad(10.0), theta_r, "diffuse"))
        quantity = "diffuse DoP (%) of sample 3 at θr = 30, 45, 60, 70, 80°, flat coating"
        yield _number(1, quantity, interpretation, expected, 0.06, found)


def _figure_3() -> Iterator[Number]:
    theta_r = np.deg2rad(np.arange(-85.0, 85.001, 0.05))
    specular = np.searchsorted(theta_r, np.deg2rad(FIGURE_3_INCIDENCE))
    near = np.abs(theta_r - theta_r[specular]) < np.deg2rad(20.0)

    def cut(model: Model, flat: bool) -> np.ndarray:
        """Signed Q/I; with a flat coating for the body light if asked for."""
        if not flat:
            return figure_3_cut(model, theta_r)[1]
        incidence = np.deg2rad(FIGURE_3_INCIDENCE)
        stokes = in_plane(model, incidence, theta_r, "specular")
        stokes = stokes + in_plane(model.replace(sigma=_FLAT), incidence, theta_r, "diffuse")
        values: np.ndarray = stokes[:, 1] / stokes[:, 0]
        return values

    def outer_zeros(q: np.ndarray) -> np.ndarray:
        zeros = np.rad2deg(zero_crossings(theta_r, q))
        return zeros[[0, -1]] if len(zeros) else np.full(2, np.nan)

    weighted, amplitude, visible, literal = INTERPRETATIONS
    for interpretation, zeros, tolerance in (
        (weighted, (-3.45, 64.35), 0.05),
        (amplitude, (-2.6, 54.05), 0.05),
        (visible, (-2.4, 58.5), 0.1),
    ):
        quantity = "figure 3: zeros of the DoP (°), flat coating"
        found = outer_zeros(cut(interpretation.figure_3(), flat=True))
        yield _number(4, quantity, interpretation, zeros, tolerance, found)
    full = cut(weighted.figure_3(), flat=False)
    yield _number(
        4,
        "figure 3: zeros of the DoP (°), facets of σ = 0.1",
        weighted,
        (-3.82, 64.67),
        0.02,
        outer_zeros(full),
    )
    for interpretation, (degree, angle) in (
        (weighted, (0.205, 46.0)),
        (amplitude, (0.118, 39.5)),
        (visible, (0.137, 42.0)),
    ):
        q = cut(interpretation.figure_3(), flat=True)
        peak = int(np.argmax(np.where(near, -q, -np.inf)))
        yield _number(
            4,
            "figure 3: largest DoP near specular (%), flat coating",
            interpretation,
            (100 * degree,),
            0.1,
            (-100 * q[peak],),
        )
        yield _number(
            4,
            "figure 3: angle of that maximum (°)",
            interpretation,
            (angle,),
            0.5,
            (float(np.rad2deg(theta_r[peak])),),
        )
    q = cut(literal.figure_3(), flat=True)
    yield _number(
        4,
        "figure 3: DoP at the mirror direction (%), flat coating",
        literal,
        (3.6,),
        0.1,
        (-100 * q[specular],),
    )


def _peaks() -> Iterator[Number]:
    model = INTERPRETATIONS[0].sample(3)
    half = 0.5 * _BISTATIC
    found = in_plane(model, half, half)[:, 0] * np.cos(half)
    quantity = "f cosθi of sample 3 in the mirror direction at Ψ = 30, 50, 70, 90°"
    yield _number(10, quantity, INTERPRETATIONS[0], (1.91, 1.99, 2.19, 2.70), 0.0101, found)


def _diffuse_ratios() -> Iterator[Number]:
    theta_i, near, far = np.deg2rad(DIFFUSE_AT)
    table = (
        (0.85, 0.83, 0.85, 0.81, 0.95),
        (1.26, 1.20, 1.24, 1.07, 1.30),
        (0.78, 0.70, 0.75, 0.46, 0.88),
        (1.17, 1.02, 1.10, 0.61, 1.22),
    )
    for interpretation, expected in zip(INTERPRETATIONS, table, strict=True):
        pairs = [in_plane(m, theta_i, [near, far], "diffuse")[:, 0] for m in interpretation.samples()]
        quantity = "diffuse intensity at θr = 60° over that at 20°, θi = 10°, samples 1 … 5"
        yield _number(11, quantity, interpretation, expected, 0.0101, [b / a for a, b in pairs])


def _maxima() -> Iterator[Number]:
    interpretation, turn, half = INTERPRETATIONS[0], offsets(9.0), 0.5 * _BISTATIC
    model = interpretation.sample(3)
    fresnel = dolp(in_plane(model, half, half, "specular"))
    yield _number(
        16,
        "DoP of the facets alone, sample 3, Ψ = 30, 50, 70, 90°",
        interpretation,
        (0.087, 0.248, 0.495, 0.785),
        5.1e-4,
        fresnel,
    )
    best = dolp(in_plane(model, *turned(_BISTATIC, turn))).max(axis=1)
    yield _number(
        16,
        "largest DoP of sample 3 at Ψ = 30, 50, 70, 90°",
        interpretation,
        (0.066, 0.194, 0.409, 0.694),
        0.0015,
        best,
    )
    theta = np.deg2rad(np.arange(50.0, 70.0, 0.05))
    found = [
        float(np.rad2deg(theta[dolp(in_plane(m, theta, theta, "specular")).argmax()]))
        for m in interpretation.samples()
    ]
    expected = (60.9, 59.4, 58.3, 59.9, 60.1)
    yield _number(16, "Brewster angle (°) of samples 1 … 5", interpretation, expected, 0.08, found)


def _zeros() -> Iterator[Number]:
    """Zeros beside the peak were expected at 6° to 7° (sample 3) and 1.4° (sample 1)."""
    interpretation, turn = INTERPRETATIONS[0], offsets(12.0)
    for number, middle, tolerance in ((1, 1.4, 0.15), (3, 6.5, 0.5)):
        for psi in np.deg2rad([50.0, 70.0]):
            (stokes,) = in_plane(interpretation.sample(number), *turned(psi, turn))
            zeros = np.abs(np.rad2deg(zero_crossings(turn, stokes[:, 1] / stokes[:, 0])))
            quantity = f"zeros of the DoP left and right of the peak (°), sample {number}, Ψ = {np.rad2deg(psi):.0f}°"
            yield _number(18, quantity, interpretation, (middle, middle), tolerance, zeros[[0, -1]])


def _equal_view() -> Iterator[Number]:
    theta_i, theta_r = np.deg2rad([0.0, 20.0, 40.0, 60.0]), np.deg2rad(60.0)
    rows: list[tuple[Interpretation, int, tuple[float, ...], float]] = [
        (INTERPRETATIONS[0], 3, (7.82,) * 4, 0.0051),
        (INTERPRETATIONS[0], 4, (5.34,) * 4, 0.0051),
        (INTERPRETATIONS[2], 3, (8.52, 8.63, 8.70, 8.72), 0.011),
        (INTERPRETATIONS[2], 4, (7.4, 8.7, 9.5, 9.8), 0.051),
    ]
    for interpretation, number, expected, tolerance in rows:
        # the average over facets of the letter of eq. (13) needs the higher accuracy for four digits
        model = interpretation.sample(number).replace(sigma=_FLAT, accuracy="high")
        found = 100.0 * dolp(in_plane(model, theta_i, theta_r, "diffuse"))
        quantity = f"diffuse DoP (%) of sample {number} at θr = 60°, θi = 0, 20, 40, 60°, flat coating"
        yield _number(19, quantity, interpretation, expected, tolerance, found)
