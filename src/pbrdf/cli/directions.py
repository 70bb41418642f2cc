"""Directions of illumination and view as ``--theta-i``, ``--theta-r`` and ``--phi`` give them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pbrdf.cli.values import angles
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    import numpy as np

__all__ = ["GRID", "PLANE_THETA_R", "directions_of"]

#: Directions over the hemisphere, degrees.
GRID = {"theta_i": "10:80:10", "theta_r": "0:85:5", "phi": "0:360:15"}
#: Viewing angles in the plane of incidence, degrees.
PLANE_THETA_R = "-85:85:1"
#: About 16 GB of Mueller matrices; more is a slip of the pen.
_MOST_GEOMETRIES = 20_000_000


def directions_of(
    theta_i: str | None, theta_r: str | None, phi: str | None, plane: bool, bistatic: str | None
) -> dict[str, np.ndarray]:
    """Angles in radians and groups of every geometry, shape (N,).

    Parameters
    ----------
    theta_i, theta_r, phi
        What the options say; None for :data:`GRID`, in plane for :data:`PLANE_THETA_R`.
    plane
        Whether to stay in the plane of incidence, where negative viewing angles are on the source's side.
    bistatic
        Angles between source and camera with the sample turning between them; None for none.

    Raises
    ------
    PbrdfError
        If an angle is out of range, or there are too many geometries.
    """
    import numpy as np

    if bistatic is not None:
        between = angles(bistatic, "--bistatic")
        views = angles(theta_r or PLANE_THETA_R, "--theta-r")
        total, s = (a.ravel() for a in np.meshgrid(between, views, indexing="ij"))
        group = np.repeat(np.arange(1, len(between) + 1), len(views))
        incidence = total - s
        seen = (incidence >= 0.0) & (incidence < 90.0)
        if not seen.any():
            raise PbrdfError("--bistatic: with these viewing angles the source is never between 0° and 90°")
        return _checked(incidence[seen], np.abs(s[seen]), np.where(s[seen] < 0.0, 180.0, 0.0), group[seen])
    incidences = angles(theta_i or GRID["theta_i"], "--theta-i")
    views = angles(theta_r or (PLANE_THETA_R if plane else GRID["theta_r"]), "--theta-r")
    azimuths = [0.0] if plane else angles(phi or GRID["phi"], "--phi")
    count = len(incidences) * len(views) * len(azimuths)
    if count > _MOST_GEOMETRIES:
        raise PbrdfError(
            f"{count} geometries are more than the {_MOST_GEOMETRIES} allowed: take larger steps"
        )
    grids = [a.ravel() for a in np.meshgrid(incidences, views, azimuths, indexing="ij")]
    # As the readers of hemispherical data do, a group is called by its angle of incidence.
    whole = np.round(incidences).astype(int)
    labels = whole if len(set(whole)) == len(whole) else np.arange(1, len(incidences) + 1)
    group = np.repeat(labels, len(views) * len(azimuths))
    if plane:
        return _checked(grids[0], np.abs(grids[1]), np.where(grids[1] < 0.0, 180.0, 0.0), group)
    return _checked(grids[0], grids[1], grids[2], group)


def _checked(
    theta_i: np.ndarray, theta_r: np.ndarray, phi: np.ndarray, group: np.ndarray
) -> dict[str, np.ndarray]:
    import numpy as np

    from pbrdf.optics.angles import radians_within_a_turn

    for name, values in (("--theta-i", theta_i), ("--theta-r", theta_r)):
        bad = values[(values < 0.0) | (values >= 90.0)]
        if bad.size:
            raise PbrdfError(f"{name}: {bad[0]:g}° is not an angle from 0° to below 90°")
    return {
        "theta_i": np.deg2rad(theta_i),
        "theta_r": np.deg2rad(theta_r),
        "phi": radians_within_a_turn(phi),
        "group": group,
    }
