"""Several wavelengths: data before a model is fitted to them or a material looked for, and models to paint with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pbrdf.cli.reading import Reading
from pbrdf.errors import DataError, PbrdfError

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.models import Model

__all__ = ["MANY", "painted_with", "require_choice"]

#: What becomes of the data if nothing is chosen, in words.
_FITTED = "one set of parameters for all would be fitted"
#: From so many wavelengths on, one set of parameters for all is hardly meant: it has to be said.
MANY = 6


def require_choice(
    dataset: xr.Dataset,
    reading: Reading,
    source: str,
    *,
    by_wavelength: bool | None = None,
    otherwise: str = _FITTED,
) -> None:
    """Raise, with the choices, if a file of many wavelengths is to be fitted or identified and nothing says how.

    Parameters
    ----------
    dataset
        The data.
    reading
        How they were read: wavelengths that were selected are a choice.
    source
        Name of the file.
    by_wavelength
        Whether a parameter is free for each wavelength; None where the command has no such option.
    otherwise
        What would become of the data, in words.

    Raises
    ------
    DataError
        If there are :data:`MANY` wavelengths or more and none of the choices was made.
    """
    import numpy as np

    if "wavelength" not in dataset.coords or by_wavelength or reading.wavelength:
        return
    if any(text.strip().startswith("wavelength") for text in reading.select):
        return
    known = np.unique(dataset["wavelength"].values)
    known = known[np.isfinite(known)]
    if known.size < MANY:
        return
    middle = known[known.size // 2]
    low, high = np.floor(known[0]), np.ceil(known[-1])
    split = "" if by_wavelength is None else "; --split a=wavelength for a of each and the rest shared"
    raise DataError(
        f"{source}: there are {known.size} wavelengths, {known[0]:g} … {known[-1]:g} nm, and {otherwise}; choose "
        f"--wavelength {middle:g} for one{split}; or --select wavelength={low:g}:{high:g} if one set for these is meant"
    )


def painted_with(
    sources: Sequence[str], wavelengths: Sequence[float | None]
) -> list[tuple[str, list[Model]]]:
    """What each object is painted with: the name of the source, and the model of each wavelength.

    Parameters
    ----------
    sources
        As of :func:`pbrdf.cli.sources.open_model`: for each object one for each wavelength in turn, or the
        folder of a fit with parameters of each wavelength.
    wavelengths
        nm; None where none is stated.

    Raises
    ------
    PbrdfError
        If models do not go into the wavelengths, a fit knows one of them not, or one is to be chosen of a fit.
    """
    from pbrdf.cli.sources import models_at, open_model

    painted: list[tuple[str, list[Model]]] = []
    waiting: list[str] = []
    for source in sources:
        models = models_at(source, wavelengths)
        if models is not None and not waiting:
            painted.append((source, models))
            continue
        waiting.append(source)
        if len(waiting) == len(wavelengths):
            painted.append((waiting[0], [open_model(one) for one in waiting]))
            waiting = []
    if waiting:
        raise PbrdfError(
            f"--wavelength: each object needs {len(wavelengths)} models, one for each wavelength, and {waiting[-1]} is "
            f"not followed by as many; or give the folder of a fit with --split NAME=wavelength"
        )
    return painted
