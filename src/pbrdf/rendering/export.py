"""Models as files for other programs: Mitsuba's ``measured_polarized``, MERL tables, grids of Mueller matrices."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrdf.data.build import make_dataset
from pbrdf.data.formats.merl import COLOURS, SHAPE, cell_centres, write_planes
from pbrdf.data.formats.pbsdf import MOST_WAVELENGTHS, SIMULATED, PolarizedTable, write_table
from pbrdf.errors import DataError, ModelError
from pbrdf.models import Model
from pbrdf.optics.half_difference import directions
from pbrdf.rendering.storable import require_finite, storable
from pbrdf.rendering.tabulation import TableError, refined_table
from pbrdf.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["AIMS", "UNSTATED_WAVELENGTH", "PbsdfExport", "grid_dataset", "write_merl", "write_pbsdf"]

#: Limits of the median and of the 99th percentile of a table's error |Δ|/f00 that :func:`write_pbsdf` aims at: 0.2 %
#: and 1 %, less what the plugin's single precision adds.
AIMS = (0.0017, 0.009)

#: Written into a ``.pbsdf`` file, which must name a wavelength, where a single model's is not stated; nm.
UNSTATED_WAVELENGTH = 550

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class PbsdfExport:
    """A ``.pbsdf`` file that was written.

    Attributes
    ----------
    path
        The file.
    table
        Its content.
    errors
        Errors of interpolation, see :class:`pbrdf.rendering.tabulation.TableError`.
    accurate
        Whether they are as small as was asked for.
    alpha_sample
        Roughness by which the plugin shall sample directions: √2 σ of the narrowest lobe.
    below
        Number of cells that are 0 because the model is below 0 there, by rounding.
    """

    path: Path
    table: PolarizedTable
    errors: list[TableError]
    accurate: bool
    alpha_sample: float
    below: int

    @property
    def bsdf(self) -> dict[str, Any]:
        """The BSDF for ``mitsuba.load_dict``; it needs neither this package nor its plugin.

        Where light and view have exactly one direction, the plugin itself has no number, whatever the table holds: put
        a lamp beside the camera and not at it, by a ten-thousandth of the distance or more.

        ``wavelength`` is there if the file has just one: monochromatic variants insist on it, spectral ones then use
        that one at every wavelength.
        """
        described = {
            "type": "measured_polarized",
            "filename": str(self.path),
            "alpha_sample": self.alpha_sample,
        }
        if len(self.table.wavelength) == 1:
            described["wavelength"] = float(self.table.wavelength[0])
        return described

    @property
    def xml(self) -> str:
        """The same BSDF for a scene file."""
        lines = [f'<bsdf type="{self.bsdf["type"]}">']
        for name, value in list(self.bsdf.items())[1:]:
            kind = "string" if isinstance(value, str) else "float"
            lines.append(f'    <{kind} name="{name}" value={quoteattr(f"{value}")}/>')
        return "\n".join([*lines, "</bsdf>"])


def write_pbsdf(
    models: Model | Sequence[Model],
    path: str | Path,
    *,
    wavelengths: float | Sequence[float] | None = None,
    median: float = AIMS[0],
    percentile_99: float = AIMS[1],
    progress: Progress | None = None,
) -> PbsdfExport:
    """Tabulate a model for Mitsuba's plugin ``measured_polarized``.

    The nodes are laid where the model needs them and are added until the errors at random geometries (zenith angles up
    to 80°, half of them even over the hemispheres, half in the lobe) are as small as is asked for.

    Parameters
    ----------
    models
        A model, or one for each wavelength.
    path
        The file; replaced, when the new one is complete, if it exists.
    wavelengths
        In nm, whole numbers, one for each model. For a single model None writes :data:`UNSTATED_WAVELENGTH`.
    median, percentile_99
        Accuracy: limits of the median and the 99th percentile of |Δ|/f00.
    progress
        Called with the finished and all parts of the table; it starts anew when the table is refined.

    Raises
    ------
    ModelError
        If a parameter is an array, wavelengths and models do not match or are too many for the plugin, or a model
        somewhere is not finite or below 0, by more than a millionth of its value in the mirror direction of 30°.
    DataError
        If the file cannot be written.
    """
    path = _checked(path)
    ordered = _by_wavelength(_models(models), wavelengths)
    table, errors, below = refined_table(
        list(ordered.values()),
        list(ordered),
        median=median,
        percentile_99=percentile_99,
        progress=progress,
    )
    described = "; ".join(f"{wavelength} nm {model!r}" for wavelength, model in ordered.items())
    table = replace(table, description=f"{SIMULATED} {__version__}: {described}")
    write_table(table, path)
    width = min(float(model.lobe_width()) for model in ordered.values())
    return PbsdfExport(
        path=path,
        table=table,
        errors=errors,
        accurate=all(e.median <= median and e.percentile_99 <= percentile_99 for e in errors),
        alpha_sample=float(f"{math.sqrt(2.0) * width:.2g}"),
        below=below,
    )


def write_merl(
    models: Model | Sequence[Model], path: str | Path, *, progress: Progress | None = None
) -> NDArray[np.float64]:
    """Tabulate the BRDF under natural light as a MERL ``.binary`` file.

    The cells hold the value at their middle, the mean of both directions of the light: the format takes reciprocity
    for granted. Cells with a direction below the horizon are invalid; elsewhere a value below 0 by rounding is 0 in the
    file, as a reader would take it for none.

    Parameters
    ----------
    models
        A model for all three colours, or three for red, green and blue.
    path
        The file; replaced, when the new one is complete, if it exists.
    progress
        Called with the finished and all parts of the table.

    Returns
    -------
    ndarray
        What was written, 1/sr, shape (3, 90, 90, 180), NaN where invalid.

    Raises
    ------
    ModelError
        If there are neither one nor three models, a parameter is an array, or a model somewhere is not finite or below
        0, see :func:`write_pbsdf`.
    DataError
        If the file cannot be written.
    """
    path = _checked(path)
    given = _models(models)
    if len(given) not in (1, len(COLOURS)):
        raise ModelError(f"{len(given)} models for a MERL table: give one, or three for {', '.join(COLOURS)}")
    theta_h, theta_d, phi_d = cell_centres()
    planes = np.full((len(COLOURS), *SHAPE), np.nan)
    for row, angle in enumerate(theta_h):
        theta_i, theta_r, phi = directions(angle, theta_d[:, np.newaxis], phi_d)
        above = (theta_i < np.pi / 2) & (theta_r < np.pi / 2)
        for which, model in enumerate(given):
            one_way = np.full(above.shape, np.nan)
            geometry = theta_i[above], theta_r[above], phi[above]
            f00 = model.stokes(*geometry)[:, :1, np.newaxis]
            one_way[above] = storable(f00, model, *geometry).values[:, 0, 0]
            # Exchanging the rays is φ_d + π, and the mirror image of that π − φ_d: the axis turned round.
            planes[which, row] = 0.5 * (one_way + one_way[:, ::-1])
        if progress is not None:
            progress(row + 1, len(theta_h))
    if len(given) == 1:
        planes[1:] = planes[0]
    write_planes(planes, path)
    return planes


def grid_dataset(
    models: Model | Sequence[Model],
    theta_i: ArrayLike,
    theta_r: ArrayLike,
    phi: ArrayLike,
    *,
    wavelengths: float | Sequence[float] | None = None,
) -> xr.Dataset:
    """Mueller matrices at given geometries as a data set that can be written, read and fitted.

    Parameters
    ----------
    models
        A model, or one for each wavelength.
    theta_i, theta_r, phi
        Radians, shape (N,); zenith angles below π/2.
    wavelengths
        In nm, one for each model; None states none, for a single model.

    Returns
    -------
    xarray.Dataset
        ``mueller``, 1/sr, wavelength by wavelength; ``group`` is θ_i in whole degrees.

    Raises
    ------
    ModelError
        If a parameter is an array, wavelengths and models do not match, or a model is not finite at a geometry: a data
        set would leave it out as not measured. What is below 0 is kept; to read it back is to be told.
    """
    given = _models(models)
    stated = _matching(given, wavelengths)
    angles = [np.ravel(a) for a in np.broadcast_arrays(theta_i, theta_r, phi)]
    matrices = [model.mueller(*angles) for model in given]
    for model, found in zip(given, matrices, strict=True):
        require_finite(found, model, *angles)
    rows = len(angles[0])
    repeated = [np.tile(a, len(given)) for a in angles]
    return make_dataset(
        *repeated,
        quantity="brdf",
        mueller=np.concatenate(matrices),
        wavelength=None if stated is None else np.repeat(stated, rows),
        group=np.round(np.rad2deg(repeated[0])).astype(np.int64),
        simulated=True,
        attrs={
            "title": f"Mueller matrices of the model {', '.join(dict.fromkeys(m.name for m in given))}",
            "source": f"{SIMULATED} {__version__}: {'; '.join(map(repr, given))}, without noise",
        },
    )


def _checked(path: str | Path) -> Path:
    """The path; raises DataError before the work is done if there is no folder for the file."""
    path = Path(path)
    if not path.parent.is_dir():
        raise DataError(f"{path}: there is no folder {path.parent}")
    return path


def _models(models: Model | Sequence[Model]) -> list[Model]:
    given = [models] if isinstance(models, Model) else list(models)
    if not given:
        raise ModelError("there is no model to tabulate")
    for model in given:
        arrays = [name for name, value in model.values.items() if np.ndim(value)]
        if arrays:
            raise ModelError(f"{arrays[0]} of {model!r} is an array: tabulate models with single numbers")
    return given


def _matching(models: list[Model], wavelengths: float | Sequence[float] | None) -> list[float] | None:
    """The wavelengths as a list, one for each model."""
    if wavelengths is None and len(models) == 1:
        return None
    stated = [] if wavelengths is None else [float(w) for w in np.atleast_1d(wavelengths)]
    if len(stated) != len(models):
        raise ModelError(
            f"state one wavelength for each model: models are given {len(models)}, wavelengths {len(stated)}"
        )
    return stated


def _by_wavelength(models: list[Model], wavelengths: float | Sequence[float] | None) -> dict[int, Model]:
    """Models by whole nanometres, ascending, no more than the plugin can hold."""
    stated = _matching(models, wavelengths) or [float(UNSTATED_WAVELENGTH)]
    if len(stated) > MOST_WAVELENGTHS:
        raise ModelError(
            f"{len(stated)} wavelengths are too many for one .pbsdf file: Mitsuba's measured_polarized has room for "
            f"{MOST_WAVELENGTHS} and reads beyond it without a warning; write several files"
        )
    for wavelength in stated:
        if not (wavelength.is_integer() and 0 < wavelength < 2**16):
            raise ModelError(
                f"a .pbsdf file has no place for the wavelength {wavelength:g} nm, it holds whole nanometres: round it"
            )
    if len(set(stated)) < len(stated):
        raise ModelError("two models have the same wavelength")
    named = {int(wavelength): model for wavelength, model in zip(stated, models, strict=True)}
    return dict(sorted(named.items()))
