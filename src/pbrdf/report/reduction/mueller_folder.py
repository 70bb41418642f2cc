"""What a reduction of Mueller matrices leaves behind: a folder with a table and data sets, and a few lines to read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pbrdf.data.readers import write
from pbrdf.files.atomic import atomic_folder
from pbrdf.files.delimited import write_table
from pbrdf.instruments.goniometer.angle_table import AngleTable
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.mueller_properties import UNKNOWN_RETARDANCE, Properties, mueller_properties
from pbrdf.instruments.reduction.mueller_reduction import MuellerMeans, mueller_dataset
from pbrdf.optics.mueller import coherency_eigenvalues
from pbrdf.report.numbers import with_error
from pbrdf.report.reduction.gallery import safe_name
from pbrdf.report.reduction.mueller_figure import properties_figure
from pbrdf.report.style import save_figure
from pbrdf.version import __version__

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["mueller_warnings", "print_mueller", "write_mueller"]

#: Readings that differ from those of the matrix by more than this share of their mean, or by so many times their noise,
#: contradict the settings; a difference below the last share is nobody's concern.
_CONTRADICTION, _NOISES, _SMALL = 0.02, 2.0, 0.002
#: Negative eigenvalues of the coherency matrix up to this share of m00 are nobody's concern.
_UNPHYSICAL = 0.02
#: What is printed of a matrix, in words and with its unit.
_QUANTITIES = (
    ("diattenuation", "diattenuation", ""),
    ("polarizance", "polarizance", ""),
    ("depolarization", "depolarisation", ""),
    ("retardance_deg", "retardance", "°"),
    ("fast_axis_deg", "fast axis", "°"),
)
#: More matrices than this are not printed.
_MOST = 6


def write_mueller(
    found: Mapping[str, MuellerMeans],
    instrument: Instrument,
    directory: Path,
    *,
    angles: AngleTable | None,
    suffix: str,
    name: str,
    pictures: bool = True,
) -> list[Path]:
    """Write ``summary.csv``, of several series ``properties.png``, and with angles a data set for each region.

    Parameters
    ----------
    found
        Mueller matrices by region.
    instrument
        What measured them.
    directory
        The folder; files of the same names are replaced.
    angles
        Of the series, or None.
    suffix
        Extension of the data sets.
    name
        What to call the readings.
    pictures
        Whether to draw the figure.

    Returns
    -------
    list
        The files.

    Raises
    ------
    DataError
        If the angles do not fit or the folder cannot be written.
    """
    names = ["summary.csv"]
    with atomic_folder(directory, fill=True) as temporary:
        elements = [f"m{i}{j}" for i in range(4) for j in range(4)]
        header = ["series", "region", "good", "saturated", "dead", *elements, *(f"{e}_std" for e in elements)]
        properties = {region: mueller_properties(means) for region, means in found.items()}
        quantities = [f"{q}{end}" for q in next(iter(properties.values())) for end in ("", "_std")]
        rows = [
            [series, region, *means.counts[k].values(), *map(repr, _numbers(means, properties[region], k))]
            for region, means in found.items()
            for k, series in enumerate(means.names)
        ]
        write_table(temporary / names[0], [*header, "residual", *quantities], rows)
        if angles is not None:
            for region, means in found.items():
                attrs = {
                    "title": f"Mueller matrices of {region}",
                    "source": f"{name}, reduced by pbrdf {__version__}",
                }
                names.append(f"{safe_name(region)}{suffix}")
                write(mueller_dataset(means, instrument, angles, attrs=attrs), temporary / names[-1])
        if pictures and any(len(means.names) > 1 for means in found.values()):
            names.insert(1, "properties.png")
            save_figure(properties_figure(found, properties, angles, name), temporary / names[1])
    return [directory / file for file in names]


def _numbers(means: MuellerMeans, properties: Properties, series: int) -> list[float]:
    """Elements, their standard uncertainties, the residual, and what the matrix says with errors."""
    return [
        *means.mueller[series].ravel().tolist(),
        *means.std[series].ravel().tolist(),
        float(means.residual[series]),
        *(float(values[series]) for pair in properties.values() for values in pair),
    ]


def mueller_warnings(found: Mapping[str, MuellerMeans]) -> list[str]:
    """What a user should know, one sentence each."""
    said = []
    for region, means in found.items():
        residual = np.nan_to_num(means.residual)
        limit = np.where(np.isnan(means.noise), _CONTRADICTION, np.maximum(_NOISES * means.noise, _SMALL))
        worst = int(np.argmax(residual / limit))
        if residual[worst] > limit[worst]:
            said.append(
                f"{region}, series {means.names[worst]!r}: the readings differ from those of the Mueller matrix by "
                f"{means.residual[worst]:.1%} of their mean: is the order of the states right, and was the light "
                "steady? (A wrong retardance does not show so: measure without a sample, compare with the unit matrix.)"
            )
        said += _unphysical(region, means)
        lost = [n for n, c in zip(means.names, means.counts, strict=True) if not c["good"]]
        if lost:
            said.append(f"{region}: no good pixel in series {', '.join(lost)}")
    return said


def _unphysical(region: str, means: MuellerMeans) -> list[str]:
    """Whether a matrix is none of a passive sample, by more than noise."""
    for name, M, std in zip(means.names, means.mueller, means.std, strict=True):
        if not np.isfinite(M).all():
            continue
        least = float(coherency_eigenvalues(M).min())
        # an eigenvalue is a mean of elements: of noise alone it is not below a few of their standard errors
        noise = float(np.nanmax(std)) if np.isfinite(std).any() else 0.0
        if least < -max(_NOISES * noise, _UNPHYSICAL * M[0, 0]):
            return [
                f"{region}, series {name!r}: no sample has this Mueller matrix (an eigenvalue of its coherency matrix "
                f"is {least / M[0, 0]:.2g} of m00): are the retardances and axes of the instrument right? Measure "
                "without a sample, and compare with the unit matrix"
            ]
    return []


def print_mueller(found: Mapping[str, MuellerMeans], console: Console) -> None:
    """Print intensities, normalised matrices and what they say, with standard errors."""
    shown = 0
    for region, means in found.items():
        properties = mueller_properties(means)
        for k, series in enumerate(means.names):
            if shown == _MOST:
                console.print("… more in summary.csv")
                return
            shown += 1
            M, std = means.mueller[k], means.std[k]
            console.print(
                f"{region}, series {series}: m00 = {M[0, 0]:.6g} ± {std[0, 0]:.2g}; the matrix over m00:",
                markup=False,
            )
            with np.errstate(divide="ignore", invalid="ignore"):
                ratios, errors = M / M[0, 0], std / M[0, 0]
            for row, error in zip(ratios, errors, strict=True):
                cells = (f"{m: .4f} ± {e:.4f}" for m, e in zip(row, error, strict=True))
                console.print("  " + "   ".join(cells), markup=False)
            for line in _said(properties, k):
                console.print(f"  {line}", markup=False)


def _said(properties: Properties, series: int) -> list[str]:
    """What the matrix of a series says, in words; nothing of angles that it leaves open."""
    numbers = {name: (float(value[series]), float(std[series])) for name, (value, std) in properties.items()}
    words = {
        name: f"{words} {with_error(*numbers[name])}{unit}"
        for name, words, unit in _QUANTITIES
        if math.isfinite(numbers[name][0]) and not (unit and numbers[name][1] > UNKNOWN_RETARDANCE)
    }
    if "retardance_deg" not in words:
        words["retardance_deg"] = "no retardance to be told"
        words.pop("fast_axis_deg", None)
    kept = [words[name] for name, *_ in _QUANTITIES if name in words]
    return [", ".join(kept[:2]), ", ".join(kept[2:])] if len(words) > 1 else []
