"""Tables of Mueller matrices in the files that Mitsuba's plugin ``measured_polarized`` reads.

S.-H. Baek et al., "Image-based acquisition and modeling of polarimetric reflectance" (ACM Transactions on
Graphics 39(4), 139 (2020)) published theirs so. A tensor file (:mod:`pbrdf.data.formats.tensor_file`) with the fields
``theta_h`` (1, Nh), ``theta_d`` (1, Nd) and ``phi_d`` (1, Np), float32 in radians (the angles of
:mod:`pbrdf.optics.half_difference`); ``wvls`` (Nw,), uint16 in nm; and ``M``, float32 of shape (Np, Nd, Nh, Nw, 4, 4),
in 1/sr, without a cosine. Where there is a field ``description`` (uint8, UTF-8 text), it says where the table comes
from.

The matrices stand in Mitsuba's convention, x normal to the plane of both rays: Q = I_s − I_p, V > 0 right
circular, s and p those of the scattering plane. The plugin interpolates linearly in all angles and takes the
first or last node outside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.build import assemble
from pbrdf.data.convert import from_mitsuba_mueller
from pbrdf.data.formats.declaration import Reader
from pbrdf.data.formats.tensor_file import is_tensor_file, read_tensors, write_tensors
from pbrdf.data.formats.thinning import thinning, thinning_in_words
from pbrdf.data.schema import NATURAL_LIGHT
from pbrdf.data.select import match_wavelengths
from pbrdf.data.validation import validate
from pbrdf.errors import DataError
from pbrdf.optics.half_difference import (
    directions,
    from_scattering_plane,
    half_difference,
    to_scattering_plane,
)

__all__ = [
    "HORIZON",
    "MOST_WAVELENGTHS",
    "READER",
    "SIMULATED",
    "PolarizedTable",
    "dataset_from_table",
    "mueller_from_pbsdf",
    "mueller_to_pbsdf",
    "read_pbsdf",
    "read_table",
    "write_table",
]

#: The plugin copies the wavelengths into an array of this size, without looking how many there are.
MOST_WAVELENGTHS = 5

#: Smallest cosine of a zenith angle at which a cell has a value of its own; the others are filled.
HORIZON = 1e-6

#: How the description of a table begins that a model produced.
SIMULATED = "SIMULATED by pbrdf"

_AXES = ("theta_h", "theta_d", "phi_d")


def mueller_to_pbsdf(
    mueller: ArrayLike, theta_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> NDArray[np.float64]:
    """Mueller matrices as the file holds them.

    Parameters
    ----------
    mueller
        Shape (..., 4, 4), Q = I_p − I_s of the surface.
    theta_h, theta_d, phi_d
        Radians, shape (...).
    """
    # its own inverse
    return from_mitsuba_mueller(to_scattering_plane(mueller, theta_h, theta_d, phi_d))


def mueller_from_pbsdf(
    mueller: ArrayLike, theta_h: ArrayLike, theta_d: ArrayLike, phi_d: ArrayLike
) -> NDArray[np.float64]:
    """Inverse of :func:`mueller_to_pbsdf`."""
    return from_scattering_plane(from_mitsuba_mueller(mueller), theta_h, theta_d, phi_d)


@dataclass(frozen=True)
class PolarizedTable:
    """Mueller matrices over half and difference angles, as a file holds them.

    Attributes
    ----------
    theta_h, theta_d, phi_d
        Nodes in radians, ascending, float32 in a file; shapes (Nh,), (Nd,) and (Np,).
    wavelength
        In nm, whole numbers, shape (Nw,).
    matrices
        Shape (Np, Nd, Nh, Nw, 4, 4), float32 in a file, in the convention of the file, 1/sr.
    description
        Where the table comes from; begins with :data:`SIMULATED` if a model produced it.
    """

    theta_h: NDArray[np.floating[Any]]
    theta_d: NDArray[np.floating[Any]]
    phi_d: NDArray[np.floating[Any]]
    wavelength: NDArray[Any]
    matrices: NDArray[np.floating[Any]]
    description: str = ""

    def mueller(
        self, theta_i: ArrayLike, theta_r: ArrayLike, phi: ArrayLike, wavelength: int = 0
    ) -> NDArray[np.float64]:
        """What the plugin makes of the table: linear interpolation, the last node's value outside.

        Parameters
        ----------
        theta_i, theta_r, phi
            Radians, φ = 0 forward; shape (...).
        wavelength
            Index of the wavelength.

        Returns
        -------
        ndarray
            Shape (..., 4, 4), the project's convention, 1/sr, in float64.
        """
        angles = half_difference(theta_i, theta_r, phi)
        lower, weight = [], []
        for nodes, angle in zip((self.theta_h, self.theta_d, self.phi_d), angles, strict=True):
            nodes = nodes.astype(np.float64)
            inside = np.clip(angle, nodes[0], nodes[-1])
            index = np.clip(np.searchsorted(nodes, inside, "right") - 1, 0, len(nodes) - 2)
            lower.append(index)
            weight.append((inside - nodes[index]) / (nodes[index + 1] - nodes[index]))
        matrix = np.zeros((*angles[0].shape, 4, 4))
        for corner in np.ndindex(2, 2, 2):
            h, d, p = (index + step for index, step in zip(lower, corner, strict=True))
            share = np.prod([w if step else 1.0 - w for w, step in zip(weight, corner, strict=True)], axis=0)
            matrix += share[..., np.newaxis, np.newaxis] * self.matrices[p, d, h, wavelength]
        return mueller_from_pbsdf(matrix, *angles)


def read_table(path: str | Path) -> PolarizedTable:
    """Read a ``.pbsdf`` file as it is; the matrices stay in the file until they are used.

    Raises
    ------
    DataError
        If the file is no tensor file, is truncated, lacks a field, or a field has another shape or type or
        nodes that do not ascend.
    """
    path = Path(path)
    fields = read_tensors(path)
    missing = [name for name in (*_AXES, "wvls", "M") if name not in fields]
    if missing:
        raise DataError(f"{path}: this tensor file has no field {missing[0]!r}: it is not a .pbsdf table")
    for name in (*_AXES, "wvls", "M"):
        wanted = "uint16" if name == "wvls" else "float32"
        if fields[name].dtype != np.dtype(wanted):
            raise DataError(f"{path}: the field {name!r} is {fields[name].dtype}, not {wanted}")
    counts = tuple(fields[name].size for name in ("phi_d", "theta_d", "theta_h", "wvls"))
    if fields["M"].shape != (*counts, 4, 4):
        raise DataError(
            f"{path}: the field 'M' has the shape {fields['M'].shape}, but the axes ask for {(*counts, 4, 4)}"
        )
    nodes = {name: np.array(fields[name]).ravel() for name in _AXES}
    _check_nodes(nodes, path)
    if not counts[-1]:
        raise DataError(f"{path}: there is no wavelength in the table")
    text = fields.get("description", np.empty(0, np.uint8))
    description = text.tobytes().decode("utf-8", errors="replace") if text.dtype == np.uint8 else ""
    return PolarizedTable(
        **nodes, wavelength=np.array(fields["wvls"]), matrices=fields["M"], description=description
    )


def _check_nodes(nodes: Mapping[str, NDArray[np.floating[Any]]], path: Path) -> None:
    for name, values in nodes.items():
        limit = np.pi if name == "phi_d" else np.pi / 2
        low = -limit if name == "phi_d" else 0.0
        # float32's π is a little larger than π
        if len(values) < 2 or not (np.diff(values) > 0).all() or values[0] < low - 1e-6:
            raise DataError(f"{path}: the nodes of {name} are not two or more ascending angles in radians")
        if values[-1] > limit + 1e-6:
            raise DataError(f"{path}: {name} reaches {values[-1]:g}, beyond {limit:g} rad: is it in degrees?")


def write_table(table: PolarizedTable, path: str | Path) -> None:
    """Write a ``.pbsdf`` file that the plugin reads right; it replaces `path` when complete.

    Raises
    ------
    DataError
        If the plugin would answer wrongly: there are more wavelengths than it can hold, or they do not ascend; nodes do
        not ascend; a cell is not finite, or has no M00 above 0 and is not 0 altogether. If the file cannot be written.
    """
    path = Path(path)
    if len(table.wavelength) > MOST_WAVELENGTHS:
        raise DataError(
            f"{path}: {len(table.wavelength)} wavelengths are too many: Mitsuba's measured_polarized reads at most "
            f"{MOST_WAVELENGTHS} and runs over the end of its array with more; write several files"
        )
    if not (np.diff(table.wavelength.astype(np.int64)) > 0).all():
        raise DataError(
            f"{path}: the wavelengths {', '.join(map(str, table.wavelength))} nm do not ascend: Mitsuba's "
            "measured_polarized would take one for another; sort them, and the matrices with them"
        )
    _check_nodes({name: getattr(table, name) for name in _AXES}, path)
    _check_cells(table, path)
    fields = {name: getattr(table, name)[np.newaxis] for name in _AXES}
    if table.description:
        fields["description"] = np.frombuffer(table.description.encode(), dtype=np.uint8)
    # The plugin reads five wavelengths even where there are fewer: M behind them keeps that within the file.
    write_tensors({**fields, "wvls": table.wavelength, "M": table.matrices}, path)


def _check_cells(table: PolarizedTable, path: Path) -> None:
    """Refuse what blackens the cells around it, and polarised light without intensity."""
    for p, phi_d in enumerate(table.phi_d):
        cells = table.matrices[p]
        m00 = cells[..., 0, 0]
        missing = ~np.isfinite(cells).all((-1, -2))
        wrong = missing | ~(m00 > 0) & (cells != 0).any((-1, -2))
        if wrong.any():
            d, h, w = np.argwhere(wrong)[0].tolist()
            angles = np.rad2deg([table.theta_h[h], table.theta_d[d], phi_d])
            named = ", ".join(f"{name} = {a:.5g}°" for name, a in zip(_AXES, angles, strict=True))
            found = (
                "holds no number in an element"
                if missing[d, h, w]
                else f"has M00 = {m00[d, h, w]:.4g} beside other elements"
            )
            raise DataError(
                f"{path}: the cell at {named} and {table.wavelength[w]} nm {found}: Mitsuba's measured_polarized would "
                "show its neighbours black, or polarised light without intensity"
            )


def read_pbsdf(
    path: str | Path, *, wavelength: float | Sequence[float] | None = None, every: int | None = None
) -> xr.Dataset:
    """Read a ``.pbsdf`` table as a data set.

    Parameters
    ----------
    path
        The file.
    wavelength
        Wavelength or wavelengths to take, in nm; all if None.
    every
        Take one node in this many along each of θ_h, θ_d and φ_d; 1 takes all. None takes as many as leave no
        more than :data:`pbrdf.data.formats.thinning.MOST_CELLS` cells at each wavelength.

    Returns
    -------
    xarray.Dataset
        ``mueller`` as a BRDF in 1/sr at the nodes of the table, φ_d by φ_d, then θ_d, θ_h and wavelength, in
        the file's order, each under its own name also where they descend. Cells with a direction below the horizon or
        an element that is not finite are left out; an M00 below 0 is noise, and is kept.

    Raises
    ------
    DataError
        As :func:`read_table`; if nothing is left of the table, or a wavelength is not in it.
    """
    path = Path(path)
    return dataset_from_table(read_table(path), path, wavelength=wavelength, every=every)


def dataset_from_table(
    table: PolarizedTable,
    path: Path,
    *,
    wavelength: float | Sequence[float] | None = None,
    every: int | None = None,
) -> xr.Dataset:
    """The data set of :func:`read_pbsdf` from a table that was read from `path`."""
    available = table.wavelength.astype(np.float64)
    chosen = match_wavelengths(available, wavelength, str(path))
    step = thinning(table.matrices.shape[:3], every, str(path))
    nodes = np.meshgrid(
        *(a[::step].astype(np.float64) for a in (table.phi_d, table.theta_d, table.theta_h)), indexing="ij"
    )
    phi_d, theta_d, theta_h = (a.ravel() for a in nodes)
    theta_i, theta_r, phi = directions(theta_h, theta_d, phi_d)
    stored = np.asarray(table.matrices[::step, ::step, ::step][:, :, :, chosen])
    stored = stored.reshape(-1, len(chosen), 4, 4)
    above = (np.cos(theta_i) > HORIZON) & (np.cos(theta_r) > HORIZON)
    cell, which = np.nonzero(above[:, np.newaxis] & np.isfinite(stored).all((2, 3)))
    if not cell.size:
        raise DataError(f"{path}: no cell of the table has a value")
    description = " ".join(table.description.split())
    ds = assemble(
        {
            "theta_i": theta_i[cell],
            "theta_r": theta_r[cell],
            "phi": phi[cell],
            "wavelength": available[chosen][which],
            "group": None,
        },
        {"mueller": mueller_from_pbsdf(stored[cell, which], theta_h[cell], theta_d[cell], phi_d[cell])},
        {},
        {
            "quantity": "brdf",
            "illumination": list(NATURAL_LIGHT),
            "simulated": int(table.description.startswith(SIMULATED)),
            "source": f"{path.name}{thinning_in_words(step)}{': ' * bool(description)}{description}",
        },
    )
    validate(ds, origin=str(path))
    return ds


READER = Reader("pbsdf", read_pbsdf, extensions=(".pbsdf", ".hpbrdf"), sniff=is_tensor_file)
