"""Values that a fit holds: numbers, numbers of each wavelength, and the index of a material at each wavelength."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pbrdf.data.refractive_index import EXTINCTION, INDEX, refractive_index
from pbrdf.data.select import WAVELENGTH_TOLERANCE
from pbrdf.errors import FitError
from pbrdf.models import Model

__all__ = ["NEGLIGIBLE", "Held", "HeldValues", "held_values", "in_words"]

#: What a parameter can be held at: a number, numbers by wavelength in nm, or a page of refractiveindex.info.
Held = float | str | Mapping[float, float]
#: The extinction of a material may be left out where it changes the reflectance at normal incidence by less, relative.
NEGLIGIBLE = 0.01
_WANTED = (
    "is held at a number, numbers by wavelength as {450: 1.52, 550: 1.51}, or a page of refractiveindex.info"
)


@dataclass(frozen=True)
class HeldValues:
    """What parameters are held at.

    Attributes
    ----------
    fixed
        Numbers by name.
    by_wavelength
        By name numbers by wavelength in nm, where these differ.
    sources
        By name a sentence on the material that an index is of.
    """

    fixed: dict[str, float] = field(default_factory=dict)
    by_wavelength: dict[str, dict[float, float]] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)

    def add(self, name: str, wavelengths: np.ndarray, values: Iterable[float]) -> None:
        """Hold a parameter at a value of each wavelength, or at one number where they are all the same."""
        numbers = [float(value) for value in values]
        if len(set(numbers)) == 1:
            self.fixed[name] = numbers[0]
        else:
            self.by_wavelength[name] = dict(zip(wavelengths.tolist(), numbers, strict=True))


def held_values(
    model: type[Model], fix: Mapping[str, Held], wavelength: np.ndarray | None, claimed: Collection[str]
) -> HeldValues:
    """What the parameters of a model are held at on data of these wavelengths.

    Of a material the extinction is held too, where the page states it and the model has a parameter for it.

    Parameters
    ----------
    model
        Has a parameter of each name in `fix`.
    fix
        By name what to hold it at.
    wavelength
        Of each geometry in nm; None where it is not known.
    claimed
        Parameters that are to be free: of these no extinction is held.

    Raises
    ------
    FitError
        If the wavelengths are not known, numbers are missing at one of them, or a material is given for a parameter
        that is no refractive index, or absorbs and the model has no extinction.
    DataError
        If there is no such page, or a wavelength lies outside of it.
    """
    found = HeldValues()
    for name, given in fix.items():
        if not isinstance(given, str | Mapping):
            try:
                found.fixed[name] = float(given)
            except TypeError:
                raise FitError(f"fix: {name} {_WANTED}") from None
            continue
        wavelengths = _known(name, given, wavelength)
        if isinstance(given, str):
            _hold_material(found, model, name, given, wavelengths, {*claimed, *fix})
        else:
            found.add(name, wavelengths, _numbers(name, given, wavelengths))
    return found


def in_words(held: Held) -> str:
    """What a parameter is held at, in a sentence."""
    if isinstance(held, str):
        return held
    return f"{len(held)} values" if isinstance(held, Mapping) else f"{held:g}"


def _known(name: str, given: str | Mapping[float, float], wavelength: np.ndarray | None) -> np.ndarray:
    """The wavelengths of the data, ascending."""
    unknown = 0 if wavelength is None else int(np.isnan(wavelength).sum())
    if wavelength is None or unknown:
        where = f" of {unknown} geometries" if unknown else ""
        raise FitError(
            f"fix: {name} is to be held at {in_words(given)}, but the data do not state the wavelength{where}: "
            "state it (--column wavelength==550, or wavelength_nm in the table of angles), or give a number"
        )
    return np.unique(wavelength)


def _numbers(name: str, given: Mapping[float, float], wavelengths: np.ndarray) -> list[float]:
    """The number of each wavelength."""
    try:
        by_key = {float(key): float(value) for key, value in given.items()}
    except (TypeError, ValueError):
        raise FitError(f"fix: {name} {_WANTED}") from None
    keys = np.array(sorted(by_key))
    numbers = []
    for wavelength in wavelengths.tolist():
        distance = np.abs(keys - wavelength)
        if not keys.size or distance.min() > WAVELENGTH_TOLERANCE:
            listed = ", ".join(f"{key:g}" for key in keys)
            raise FitError(
                f"fix: {name} has values at {listed} nm, and none at {wavelength:g} nm, which was measured"
            )
        numbers.append(by_key[float(keys[distance.argmin()])])
    return numbers


def _hold_material(
    found: HeldValues,
    model: type[Model],
    name: str,
    page: str,
    wavelengths: np.ndarray,
    claimed: Collection[str],
) -> None:
    """Hold an index, and its extinction, at those of a material."""
    extinctions = {p.extinction_of: p.name for p in model.parameters if p.extinction_of is not None}
    indices = [p.name for p in model.parameters if p.refractive_index or p.name in extinctions]
    if name not in indices:
        raise FitError(
            f"fix: {name} is no refractive index of {model.name}, which has {', '.join(indices) or 'none'}: give a "
            f"number, not {page}"
        )
    material = refractive_index(page, wavelengths)
    n = material[INDEX].values
    found.add(name, wavelengths, n)
    at = f"{wavelengths[0]:g}" if len(wavelengths) == 1 else f"{wavelengths[0]:g} … {wavelengths[-1]:g}"
    words = f"{name} is held at {_range(n)}, that of {material.attrs['page']} at {at} nm"
    extinction = extinctions.get(name)
    if EXTINCTION not in material:
        words += "; the page states no k"
    else:
        k = material[EXTINCTION].values
        words += f"; its k is {_range(k)}"
        if extinction is None:
            without, absorbing = (
                ((n - 1.0) ** 2 + x * x) / ((n + 1.0) ** 2 + x * x) for x in (np.zeros_like(k), k)
            )
            if (absorbing > (1.0 + NEGLIGIBLE) * without).any():
                raise FitError(
                    f"fix: {material.attrs['page']} absorbs, k is {_range(k)} at {at} nm, and {model.name} has no "
                    f"extinction of {name}: choose a model that has one, or give {name} as a number"
                )
            words += ", which is left out"
        elif extinction in claimed:
            words += f", but {extinction} is as asked for"
        else:
            found.add(extinction, wavelengths, k)
            words += f", at which {extinction} is held"
    found.sources[name] = f"{words} ({material.attrs['title']}; {material.attrs['database']})."


def _range(values: np.ndarray) -> str:
    low, high = f"{values.min():.5g}", f"{values.max():.5g}"
    return low if low == high else f"{low} … {high}"
