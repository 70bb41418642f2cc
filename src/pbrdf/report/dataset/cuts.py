"""Cuts through the plane of incidence: which measured points lie on one curve, and that curve drawn densely.

In the plane of incidence a geometry is two numbers, θ_i and the signed viewing angle s = ±θ_r (negative on
the source's side). Goniometers move along simple lines in that plane: a fixed source (θ_i constant), a fixed
viewer (s constant), a turning sample between a fixed source and a fixed viewer (θ_i + s, the bistatic
angle, constant), or a viewer that follows the source (s − θ_i constant, 0 in the mirror direction). Whichever
of these explains the points with the fewest lines is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrdf.report.dataset.points import Points

__all__ = ["KINDS", "Cut", "in_plane", "in_plane_cuts"]

KINDS = ("theta_i", "bistatic", "theta_r", "mirror")
#: How far the azimuth may be off the plane of incidence, degrees.
_AZIMUTH_TOLERANCE = 1.0
#: Angles nearer than this belong to the same cut, degrees.
_ANGLE_GAP = 0.3
#: Step of a drawn curve, degrees: narrow enough for a specular peak of σ = 0.005.
_STEP = 0.1
#: With fewer directions per cut than this on average there are no cuts, only scattered points.
_FEWEST_POINTS = 3
#: Measured points further apart than this are not joined, degrees.
_WIDEST_GAP = 35.0


@dataclass(frozen=True)
class Cut:
    """Points on one line in the plane of incidence.

    Attributes
    ----------
    kind
        What is constant: ``"theta_i"``, ``"bistatic"``, ``"theta_r"`` or ``"mirror"``.
    constant
        Its value in degrees.
    group
        Label of the group.
    rows
        Indices of the points, in the order of ``x``.
    x
        θ_i if the viewer is fixed or follows the source, else s, of the points, degrees.
    path_x
        The same along the drawn curve; NaN between parts that are not joined.
    """

    kind: str
    constant: float
    group: str
    rows: np.ndarray
    x: np.ndarray
    path_x: np.ndarray

    @property
    def over_incidence(self) -> bool:
        """Whether ``x`` is the angle of incidence."""
        return self.kind in ("theta_r", "mirror")

    def path_angles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """θ_i, θ_r and φ in radians along the drawn curve; NaN as in ``path_x``."""
        constant = np.where(np.isfinite(self.path_x), self.constant, np.nan)
        if self.kind == "theta_i":
            theta_i, s = constant, self.path_x
        elif self.kind == "theta_r":
            theta_i, s = self.path_x, constant
        elif self.kind == "mirror":
            theta_i, s = self.path_x, self.path_x + self.constant
        else:
            theta_i, s = np.maximum(self.constant - self.path_x, 0.0), self.path_x
        return np.deg2rad(theta_i), np.deg2rad(np.abs(s)), np.where(s < 0.0, np.pi, 0.0)


def in_plane(points: Points) -> np.ndarray:
    """Which points lie in the plane of incidence, shape (G,)."""
    phi = np.abs(points.phi)
    along_normal = np.minimum(points.theta_r, points.theta_i) < _ANGLE_GAP
    # With the source at the normal every azimuth is in a plane of incidence, but one cut is drawn, not all.
    along_normal &= points.theta_r < _ANGLE_GAP
    values: np.ndarray = (phi <= _AZIMUTH_TOLERANCE) | (phi >= 180.0 - _AZIMUTH_TOLERANCE) | along_normal
    return values


def in_plane_cuts(points: Points) -> list[Cut]:
    """The cuts through the points in the plane of incidence, by group; empty if they are on no few lines."""
    rows = np.flatnonzero(in_plane(points))
    if not rows.size:
        return []
    s = np.where(np.abs(points.phi) > 90.0, -points.theta_r, points.theta_r)
    constants = {"theta_i": points.theta_i, "bistatic": points.theta_i + s, "theta_r": s}
    constants["mirror"] = s - points.theta_i
    choices = {kind: _split(points.group, constants[kind], rows) for kind in KINDS}
    kind = min(choices, key=lambda k: len(choices[k]))
    if rows.size < _FEWEST_POINTS * len(choices[kind]):  # then there are fewer directions, too
        return []
    x = points.theta_i if kind in ("theta_r", "mirror") else s
    cuts, directions = [], 0
    for members in choices[kind]:
        members = members[np.argsort(x[members], kind="stable")]
        constant = float(np.median(constants[kind][members]))
        cuts.append(
            Cut(kind, constant, str(points.group[members[0]]), members, x[members], _path(x[members]))
        )
        directions += np.unique(np.round(x[members], 1)).size
    if directions < _FEWEST_POINTS * len(cuts):
        return []
    # Angles ascend in the legend; positions of a camera keep the order of the file.
    return cuts if kind == "bistatic" else sorted(cuts, key=lambda cut: cut.constant)


def _split(group: np.ndarray, constant: np.ndarray, rows: np.ndarray) -> list[np.ndarray]:
    """Rows of one group whose constant is the same within the gap; groups in the order of the file."""
    _, first, code = np.unique(group[rows], return_index=True, return_inverse=True)
    by_group = np.split(rows[np.argsort(code, kind="stable")], np.cumsum(np.bincount(code))[:-1])
    parts = []
    for members in (by_group[k] for k in np.argsort(first)):
        ordered = members[np.argsort(constant[members], kind="stable")]
        breaks = np.flatnonzero(np.diff(constant[ordered]) > _ANGLE_GAP) + 1
        parts += np.split(ordered, breaks)
    return parts


def _path(x: np.ndarray) -> np.ndarray:
    """Dense values through ascending ``x``, NaN where neighbours are too far apart to join."""
    pieces: list[np.ndarray] = []
    for piece in np.split(x, np.flatnonzero(np.diff(x) > _WIDEST_GAP) + 1):
        count = int(np.ceil((piece[-1] - piece[0]) / _STEP)) + 1
        # The points themselves are on the curve too, so that it passes through a narrow peak's top.
        pieces += [
            np.unique(np.concatenate([np.linspace(piece[0], piece[-1], count), piece])),
            np.array([np.nan]),
        ]
    return np.concatenate(pieces[:-1])
