"""A library of materials, and one material, in words and numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.models.parameters import shown_unit
from pbrdf.report.numbers import brief, per_cent
from pbrdf.report.printing import bare_table, plain_table, print_parts

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

    from pbrdf.identification.library import Library
    from pbrdf.identification.material import Material

__all__ = ["calibration_in_words", "print_library", "print_material", "scatter_in_words"]

#: What to do about fits that are not sound.
REMEDY = (
    "What to do: find a model that describes the specimens (`pbrdf compare DATA`, then `pbrdf library add NAME DATA "
    "--model MODEL`); hold a parameter that the data do not tell (`pbrdf fit --fix`), or measure more geometries."
)


def print_library(library: Library, name: str, console: Console) -> None:
    """Print a line for each material, and whether the library is calibrated."""
    print_parts(_listed(library, name), console)


def print_material(material: Material, console: Console) -> None:
    """Print the parameters of a material, their scatter, and where it comes from."""
    print_parts(_material(material), console)


def scatter_in_words(material: Material) -> str:
    """``assumed`` or ``estimated from 12 specimens``"""
    if material.scatter == "estimated":
        return f"estimated from {material.specimens} specimens"
    return "assumed (1 specimen)" if material.specimens == 1 else "assumed"


def calibration_in_words(library: Library) -> str:
    """What the library says of the sets that it gives."""
    calibration = library.calibration
    if calibration is None:
        return "Not calibrated: sets rest on the χ² of a linear model with Gaussian scatter."
    counts = ", ".join(
        f"{name} {len(scores)}" for name, scores in zip(calibration.names, calibration.scores, strict=True)
    )
    words = calibration.measurements or "labelled measurements"
    return f"Calibrated with {words} ({counts}); temperature {brief(calibration.temperature, 3)}."


def _listed(library: Library, name: str) -> Iterator[RenderableType]:
    count = len(library.materials)
    yield f"{name}: {count} material{'' if count == 1 else 's'}"
    if not count:
        return
    table = bare_table()
    table.add_column("material")
    table.add_column("model")
    table.add_column("wavelength", justify="right")
    table.add_column("scatter between specimens")
    table.add_column("data")
    for material in library.materials:
        table.add_row(
            material.name,
            material.space.model.name,
            _wavelength(material),
            scatter_in_words(material),
            "simulated" if material.simulated else "measured",
        )
    yield table
    if any(material.scatter == "assumed" for material in library.materials):
        yield "Assumed: too few specimens were measured to show how they differ; sets are only as good as that guess."
    doubted = [material.name for material in library.materials if material.fits.cautions]
    if doubted:
        yield (
            f"Caution: the fits behind {', '.join(doubted)} are not sound in every respect; `pbrdf library show` says "
            "why."
        )
    yield calibration_in_words(library)


def _material(material: Material) -> Iterator[RenderableType]:
    space = material.space
    options = "".join(f", {key}={value}" for key, value in space.options.items())
    kind = "simulated" if material.simulated else "measured"
    yield f"{material.name}: {space.model.name}{options}; {_wavelength(material)}, {kind}"
    values = space.to_parameters(material.mean)
    spread = np.sqrt(np.diag(material.covariance)) * np.abs(space.derivative(values))
    table = plain_table("", "parameter", "mean specimen", "scatter", "relative", "unit")
    for p, value, std in zip(space.free, values, spread, strict=True):
        factor, unit = shown_unit(p)
        table.add_row(
            p.name,
            brief(factor * value),
            brief(factor * std, 2),
            per_cent(std / abs(value)) if value else "–",
            "" if unit == "1" else unit,
        )
    table.title = None
    yield table
    if space.fixed:
        yield "Held: " + ", ".join(f"{name}={brief(value)}" for name, value in space.fixed.items())
    words = f"Scatter between specimens: {scatter_in_words(material)}."
    if material.scatter == "assumed":
        words += " No one measured how specimens differ: the numbers above are a guess."
    yield words
    yield from _fits(material)
    for sentence in material.provenance:
        yield f"From: {sentence}"


def _fits(material: Material) -> Iterator[str]:
    """What the specimens' fits are worth, and what to do where it is not much."""
    fits = material.fits
    sizes = []
    if math.isfinite(fits.reduced_chi2):
        sizes.append(f"χ² by degree of freedom {brief(fits.reduced_chi2, 2)}")
    if math.isfinite(fits.missed):
        sizes.append(f"they miss by {per_cent(fits.missed)} of the signal")
    if sizes:
        yield f"Fits of the specimens (median): {', '.join(sizes)}."
    if fits.misfits():
        yield (
            "Caution: the model misses its own specimens by more than their uncertainties. Identification takes that "
            "for a difference between materials: find a model that describes them (`pbrdf compare DATA`), or state "
            "noise that covers it (`pbrdf identify --noise`)."
        )
    for caution in fits.cautions:
        yield f"Caution: {caution}"
    if fits.cautions:
        yield REMEDY


def _wavelength(material: Material) -> str:
    return "wavelength not known" if math.isnan(material.wavelength) else f"{material.wavelength:g} nm"
