"""Goniometer protocols: which geometries are measured, in which order, and how the camera is held.

The paper's protocol (Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017)): source and camera
stand still, the bistatic angle Ψ between them fixed for each camera position, and the sample turns between them through
the angles A between its surface and the axis of the source ("Angle_S_I"): θ_i = 90° − A and θ_r = Ψ − 90° + A, both
signed in the plane of incidence. Where the camera crosses the normal to the side of the source, θ_r is negative: |θ_r|
at φ = 180°. The paper gives neither its three Ψ nor its 21 angles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.goniometer.rays import angles_of, between, ray_vectors
from pbrdf.optics.angles import within_turn

__all__ = ["BISTATIC", "LABORATORIES", "SAMPLE_ANGLES", "Protocol", "crowded_sample_angles"]

#: Bistatic angles (radians) of the camera positions 1, 2, 3, and number of sample angles, where nothing else is said.
BISTATIC = tuple(np.deg2rad([60.0, 80.0, 100.0]).tolist())
SAMPLE_ANGLES = 21
#: Largest zenith angle that :func:`crowded_sample_angles` reaches, degrees.
_LARGEST_ZENITH = 85.0

#: How the camera is held: where its x axis points.
LABORATORIES = {
    "meridian": "x in the plane of surface normal and view: the camera stands upright over the sample on a dome",
    "scattering": "x in the plane of source, sample and camera: both stay in one plane and the sample is turned in it",
    "level": "x square to the axis about which the sample turns in the plane of incidence, wherever the camera is",
}

#: Angles are taken as decimal numbers with so many places: no goniometer is set finer.
_PLACES = 9


@dataclass(frozen=True, eq=False)
class Protocol:
    """Geometries in the order in which they are measured.

    Attributes
    ----------
    theta_i, theta_r, phi
        Radians, shape (G,), φ = 0 in the forward half-plane; both zenith angles below 90°.
    group
        What a geometry belongs to (a camera position, an angle of incidence), shape (G,).
    sample_angle
        The paper's Angle_S_I, radians, shape (G,); NaN where the sample lies still.
    laboratory
        How the camera is held: a key of :data:`LABORATORIES`.
    name
        What it is, for people.
    notes
        Sentences about geometries that were left out.

    Raises
    ------
    DataError
        If shapes differ, an angle is not finite, or a ray lies at or below the horizon.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    phi: np.ndarray
    group: np.ndarray
    sample_angle: np.ndarray
    laboratory: str = "meridian"
    name: str = "protocol"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in ("theta_i", "theta_r", "phi", "sample_angle"):
            object.__setattr__(self, field, np.array(getattr(self, field), dtype=float))
        object.__setattr__(self, "group", np.array(self.group))
        if self.laboratory not in LABORATORIES:
            raise DataError(f"laboratory {self.laboratory!r}: choose one of {', '.join(LABORATORIES)}")
        if self.theta_i.ndim != 1 or not len(self.theta_i):
            raise DataError("a protocol needs at least one geometry, its angles in arrays of one dimension")
        for field in ("theta_r", "phi", "group", "sample_angle"):
            if getattr(self, field).shape != self.theta_i.shape:
                raise DataError(f"protocol: {field} has another shape than theta_i, {self.theta_i.shape}")
        for field in ("theta_i", "theta_r", "phi"):
            values = getattr(self, field)
            bad = ~np.isfinite(values)
            if field != "phi":
                bad |= (values < 0.0) | (np.cos(values) <= 1e-12)
            if bad.any():
                row = int(np.argmax(bad))
                raise DataError(
                    f"protocol: geometry {row + 1} has {field} = {np.rad2deg(values[row]):g}°: "
                    "it must be finite, and a zenith angle from 0° to below 90°"
                )

    # Constructors

    @classmethod
    def in_plane(
        cls, bistatic: ArrayLike = BISTATIC, sample_angles: ArrayLike | Sequence[ArrayLike] | None = None
    ) -> Protocol:
        """The paper's protocol: for each camera position the sample turns between source and camera.

        Parameters
        ----------
        bistatic
            Ψ of the camera positions, radians, above 0 and below 180°.
        sample_angles
            Angle_S_I, radians: one list for all positions, or a list for each; None crowds 21 of them to the mirror
            direction of each position, see :func:`crowded_sample_angles`. Angles that bring source or camera below
            the horizon are left out, and ``notes`` says so.

        Raises
        ------
        DataError
            If a bistatic angle is out of range, or no geometry is left.
        """
        positions = _positions(bistatic)
        columns: list[list[np.ndarray]] = []
        dropped: list[str] = []
        for position, psi in enumerate(positions, start=1):
            chosen = (
                crowded_sample_angles(psi)
                if sample_angles is None
                else _of_position(sample_angles, position - 1)
            )
            half = _decimal(psi) / 2.0
            # turned from the mirror direction by δ = A − (90° − Ψ/2)
            offset = np.round(np.round(np.rad2deg(chosen), _PLACES) - 90.0 + half, _PLACES)
            signed_i, signed_r = half - offset, half + offset
            # with the source beyond the normal both change sides
            signed_r = np.where(signed_i < 0.0, -signed_r, signed_r)
            seen = (np.abs(signed_i) < 90.0) & (np.abs(signed_r) < 90.0)
            if not seen.all():
                dropped.append(
                    f"{int((~seen).sum())} of {len(seen)} at position {position} ({_decimal(psi):g}°)"
                )
            phi = np.where(signed_r < 0.0, 180.0, 0.0)
            angles = (np.abs(signed_i), np.abs(signed_r), phi, np.rad2deg(chosen))
            columns.append([*(np.deg2rad(a)[seen] for a in angles), np.full(int(seen.sum()), position)])
        theta_i, theta_r, phi, sample, group = (np.concatenate(c) for c in zip(*columns, strict=True))
        if not len(theta_i):
            raise DataError("in-plane protocol: at every sample angle source or camera is below the horizon")
        name = f"in plane, bistatic angles {', '.join(f'{_decimal(psi):g}°' for psi in positions)}"
        return cls(theta_i, theta_r, phi, group, sample, "scattering", name, _statement(dropped))

    @classmethod
    def hemisphere(
        cls,
        theta_i: ArrayLike,
        theta_r: ArrayLike,
        phi: ArrayLike,
        *,
        laboratory: str = "meridian",
        obscured: float = 0.0,
    ) -> Protocol:
        """A source that stands still and a camera on a grid of zenith angles and azimuths.

        Parameters
        ----------
        theta_i
            Angles of incidence, radians; each makes a group.
        theta_r, phi
            Zenith angles and azimuths of the camera, radians; at the zenith the first azimuth serves for all.
        laboratory
            How the camera is held.
        obscured
            Geometries whose bistatic angle is smaller (radians) are left out, as the camera would stand before the
            source; ``notes`` says so.

        Raises
        ------
        DataError
            If an angle is out of range or no geometry is left.
        """
        lists = [np.atleast_1d(np.asarray(a, dtype=float)) for a in (theta_i, theta_r, phi)]
        i, r, p = (a.ravel() for a in np.meshgrid(*lists, indexing="ij"))
        group = np.repeat(np.arange(1, len(lists[0]) + 1), len(lists[1]) * len(lists[2]))
        once = (r != 0.0) | (p == lists[2][0])
        i, r, p, group = (a[once] for a in (i, r, p, group))
        whole = cls(i, r, p, group, np.full(len(i), np.nan), laboratory, "hemisphere")
        free = whole.bistatic >= obscured - 1e-12
        if not free.any():
            raise DataError("hemisphere: the camera stands before the source at every geometry")
        hidden = int((~free).sum())
        stated = [f"{hidden} with the camera before the source"] if hidden else []
        return replace(whole.subset(free), notes=_statement(stated))

    @classmethod
    def two_axes(
        cls, bistatic: ArrayLike, sample_angles: ArrayLike | Sequence[ArrayLike], tilts: ArrayLike
    ) -> Protocol:
        """Source and camera stand still, the sample turns as in the plane and is tilted out of it.

        Parameters
        ----------
        bistatic
            Ψ of the camera positions, radians, above 0 and below 180°.
        sample_angles
            Angle_S_I by which the sample turns about the axis square to source and camera, radians: one list for all
            positions, or a list for each.
        tilts
            By which the sample's normal then leaves the plane of source and camera, towards +y (p × s = k), radians.

        Raises
        ------
        DataError
            If a bistatic angle is out of range, or no geometry is above the horizon.
        """
        positions = _positions(bistatic)
        tilts = np.atleast_1d(np.asarray(tilts, dtype=float))
        grids = [
            np.meshgrid(psi, _of_position(sample_angles, i), tilts, indexing="ij")
            for i, psi in enumerate(positions)
        ]
        psi, sample, tilt = (np.concatenate([g[axis].ravel() for g in grids]) for axis in range(3))
        group = np.repeat(np.arange(1, len(positions) + 1), [g[0].size for g in grids])
        turn, zero = 0.5 * np.pi - sample, np.zeros_like(psi)
        source = np.stack([zero, zero, zero + 1.0], axis=-1)
        camera = np.stack([np.sin(psi), zero, np.cos(psi)], axis=-1)
        normal = np.stack([np.sin(turn) * np.cos(tilt), np.sin(tilt), np.cos(turn) * np.cos(tilt)], axis=-1)
        theta_i, theta_r, phi = angles_of(normal, source, camera)
        seen = (theta_i < 0.5 * np.pi - 1e-9) & (theta_r < 0.5 * np.pi - 1e-9)
        if not seen.any():
            raise DataError("two axes: at every sample angle and tilt source or camera is below the horizon")
        below = int((~seen).sum())
        stated = [f"{below} of {len(seen)}"] if below else []
        name = f"two axes, bistatic angles {', '.join(f'{_decimal(a):g}°' for a in positions)}"
        i, r, azimuth, label, turned = (a[seen] for a in (theta_i, theta_r, phi, group, sample))
        return cls(i, r, azimuth, label, turned, "scattering", name, _statement(stated))

    def at_azimuths(self, azimuths: ArrayLike, laboratory: str = "level") -> Protocol:
        """The zenith angles of a protocol in the plane of incidence at other azimuths, one after the other.

        Parameters
        ----------
        azimuths
            By which the camera is carried about the surface's normal, radians; 0 is the protocol itself.
        laboratory
            How the camera is held while it is.
        """
        turns = np.atleast_1d(np.asarray(azimuths, dtype=float))
        size = len(turns)
        columns: dict[str, Any] = {
            c: np.tile(getattr(self, c), size) for c in ("theta_i", "theta_r", "group", "sample_angle")
        }
        phi = np.concatenate([within_turn(self.phi + turn) for turn in turns])
        shown = ", ".join(f"{_decimal(turn):g}°" for turn in turns)
        return replace(
            self, phi=phi, laboratory=laboratory, name=f"{self.name}, at azimuths {shown}", **columns
        )

    def subset(self, keep: np.ndarray) -> Protocol:
        """Only some geometries; ``keep`` is a mask or an array of indices."""
        columns: dict[str, Any] = {
            c: getattr(self, c)[keep] for c in ("theta_i", "theta_r", "phi", "group", "sample_angle")
        }
        return replace(self, **columns)

    # What a geometry is

    def __len__(self) -> int:
        return len(self.theta_i)

    @property
    def bistatic(self) -> np.ndarray:
        """Angle between source and camera, radians, shape (G,)."""
        rays = ray_vectors(self.theta_i, self.theta_r, self.phi)
        return between(rays["omega_i"], rays["omega_r"])

    @property
    def series(self) -> list[str]:
        """Names of the geometries, as angle tables and files of frames call them."""
        width = max(3, len(str(len(self))))
        return [f"g{number:0{width}d}" for number in range(1, len(self) + 1)]

    @property
    def reference_angle(self) -> np.ndarray:
        """From the p direction of the reflected ray to the camera's x axis (radians, from p towards s), shape (G,).

        Within (−90°, 90°]: an axis has no head. In the plane of incidence it is 0 in all three laboratories.
        """
        return self._reference("omega_i", "omega_r", ("p_r", "s_r"))

    @property
    def source_reference_angle(self) -> np.ndarray:
        """The same for the incident ray and the axes of the source, which is held as the camera is; shape (G,)."""
        return self._reference("omega_r", "omega_i", ("p_i", "s_i"))

    def _reference(self, other: str, own: str, axes: tuple[str, str]) -> np.ndarray:
        if self.laboratory == "meridian":
            return np.zeros(len(self))
        rays = ray_vectors(self.theta_i, self.theta_r, self.phi)
        if self.laboratory == "scattering":
            along = np.einsum("gk,gk->g", rays[other], rays[own])
            x = rays[other] - along[:, None] * rays[own]
            in_line = np.linalg.norm(x, axis=1) < 1e-9  # source and camera span no plane then
            x[in_line] = rays[axes[0]][in_line]
        else:
            x = np.cross([0.0, 1.0, 0.0], rays[own])
        angle = np.arctan2(*(np.einsum("gk,gk->g", x, rays[name]) for name in reversed(axes)))
        # rounding must not tell −90° from 90°, nor 180° from 0°
        angle = np.mod(angle, np.pi)
        right = 0.5 * np.pi
        values: np.ndarray = np.where(angle > right + 1e-12, angle - np.pi, np.minimum(angle, right))
        return values

    def displaced(self, turn: ArrayLike, camera: ArrayLike, tilt: ArrayLike = 0.0) -> Protocol:
        """The geometries that there really are if the goniometer is not where it says.

        Parameters
        ----------
        turn
            Error of the sample angle, radians, shape (G,) or a number: the sample turned about the axis square to the
            plane of incidence, θ_i − turn.
        camera
            Error of the camera's position, radians: the bistatic angle is larger by it.
        tilt
            By which the normal then leaves the plane of incidence towards +y, radians.

        Raises
        ------
        DataError
            If a ray gets below the horizon by it.
        """
        rays = ray_vectors(self.theta_i, self.theta_r, self.phi)
        turn, camera, tilt = (np.broadcast_to(error, len(self)) for error in (turn, camera, tilt))
        # beyond 90° the source is on the other side of the normal, where turning on increases θ_i
        side = np.where(np.nan_to_num(self.sample_angle) > 0.5 * np.pi, -1.0, 1.0)
        normal = np.stack(
            [-np.sin(side * turn) * np.cos(tilt), np.sin(tilt), np.cos(turn) * np.cos(tilt)], axis=-1
        )
        axis = np.cross(rays["omega_i"], rays["omega_r"])
        length = np.linalg.norm(axis, axis=1, keepdims=True)
        axis = np.where(length > 1e-9, axis / np.maximum(length, 1e-9), [0.0, 1.0, 0.0])
        moved = (
            rays["omega_r"] * np.cos(camera)[:, None]
            + np.cross(axis, rays["omega_r"]) * np.sin(camera)[:, None]
        )
        theta_i, theta_r, phi = angles_of(normal, rays["omega_i"], moved)
        return replace(self, theta_i=theta_i, theta_r=theta_r, phi=phi)

    # To and from angle tables

    def angle_table(
        self,
        *,
        exposure: ArrayLike = 1.0,
        wavelength: ArrayLike | None = None,
        reference_angle: float = 0.0,
    ) -> AngleTable:
        """The angle table of a measurement by this protocol.

        Parameters
        ----------
        exposure, wavelength
            As in :class:`~pbrdf.instruments.goniometer.angle_table.AngleTable`.
        reference_angle
            Of the instrument in the laboratory's axes, radians: how far the polarimeter's x axis is turned from the
            axis that ``laboratory`` names. It is added to that of each geometry.
        """
        own = self.reference_angle
        return AngleTable(
            names=tuple(self.series),
            theta_i=self.theta_i,
            theta_r=self.theta_r,
            phi=self.phi,
            group=self.group,
            wavelength=wavelength,
            exposure=exposure,
            # where all agree with the instrument's own angle there is nothing to state
            reference_angle=own + reference_angle if np.abs(own).max() > 1e-9 else np.nan,
            sample_angle=self.sample_angle,
        )

    @classmethod
    def from_angle_table(cls, table: AngleTable, *, reference_angle: float = 0.0) -> Protocol:
        """The protocol that an angle table states.

        Parameters
        ----------
        table
            The table.
        reference_angle
            As for :meth:`angle_table`.

        Raises
        ------
        DataError
            If its reference angles are those of no laboratory of :data:`LABORATORIES`.
        """
        phi, group, sample = (np.asarray(a) for a in (table.phi, table.group, table.sample_angle))
        stated = np.asarray(table.reference_angle)
        stated = np.where(np.isnan(stated), 0.0, stated - reference_angle)
        for laboratory in LABORATORIES:
            protocol = cls(table.theta_i, table.theta_r, phi, group, sample, laboratory, "angle table")
            if (np.abs(np.sin(protocol.reference_angle - stated)) < 1e-6).all():
                return protocol
        raise DataError(
            "angle table: the reference angles are those of no laboratory known here "
            f"({', '.join(LABORATORIES)}): the frames of such a camera cannot be simulated"
        )


def crowded_sample_angles(
    bistatic: float, count: int = SAMPLE_ANGLES, largest_zenith: float = math.radians(_LARGEST_ZENITH)
) -> np.ndarray:
    """Sample angles that crowd to the mirror direction of a camera position, as the bundled experiment has them.

    The lobe of a smooth paint is narrower than any even step. The sample is turned from the mirror direction by
    ±L (j/m)², j = −m … m, rounded to a hundredth of a degree; L brings the source up to `largest_zenith` on one side,
    and the source to the normal or the camera to `largest_zenith` on the other.

    Parameters
    ----------
    bistatic
        Ψ, radians.
    count
        How many; odd numbers include the mirror direction itself.
    largest_zenith
        Radians.

    Returns
    -------
    ndarray
        Angle_S_I, radians, shape (count,).
    """
    half, zenith = _decimal(bistatic) / 2.0, _decimal(largest_zenith)
    if zenith <= half or count < 1:
        raise DataError(
            f"a bistatic angle of {2.0 * half:g}° leaves no sample angle with both rays up to {zenith:g}°"
        )
    j = np.arange(count) - (count - 1) / 2.0
    growth = np.sign(j) * (j / max((count - 1) / 2.0, 1.0)) ** 2
    reach = np.where(j < 0.0, zenith - half, min(zenith - half, half))
    values: np.ndarray = np.deg2rad(90.0 - half + np.round(reach * growth, 2))
    return values


def _positions(bistatic: ArrayLike) -> np.ndarray:
    """Bistatic angles of the camera positions, checked."""
    angles = np.atleast_1d(np.asarray(bistatic, dtype=float))
    if angles.ndim != 1 or not (np.isfinite(angles) & (angles > 0.0) & (angles < np.pi)).all():
        raise DataError("camera positions: bistatic angles must be above 0° and below 180°")
    return angles


def _of_position(sample_angles: ArrayLike | Sequence[ArrayLike], position: int) -> np.ndarray:
    """The sample angles of a camera position from one list for all or a list of lists."""
    rows = list(sample_angles) if np.iterable(sample_angles) else [sample_angles]
    if all(np.ndim(row) == 0 for row in rows):
        return np.asarray(rows, dtype=float)
    if position >= len(rows):
        raise DataError(
            f"camera positions: {len(rows)} lists of sample angles do not serve position {position + 1}"
        )
    return np.atleast_1d(np.asarray(rows[position], dtype=float))


def _decimal(radians: float) -> float:
    return round(math.degrees(radians), _PLACES)


def _statement(dropped: list[str]) -> tuple[str, ...]:
    """One sentence about what was left out, or none."""
    if not dropped:
        return ()
    return (f"Left out, as source or camera would be hidden or below the horizon: {', '.join(dropped)}.",)
