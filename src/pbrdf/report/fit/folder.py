"""The folder that a fit leaves behind."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.data.degrees import exact_degrees
from pbrdf.errors import PbrdfError
from pbrdf.files.atomic import atomic_folder
from pbrdf.files.netcdf_files import write_netcdf_file
from pbrdf.inversion.stored_result import FILE_NAME, write_result
from pbrdf.models.parameters import shown_unit
from pbrdf.report.fit.page import page_text
from pbrdf.report.fit.subject import Report
from pbrdf.report.fit.summary import summary_text
from pbrdf.report.numbers import plain
from pbrdf.report.page import figure as framed
from pbrdf.report.style import FIGURE_FORMATS
from pbrdf.version import __version__

if TYPE_CHECKING:
    import xarray as xr
    from markupsafe import Markup

    from pbrdf.inversion.estimates import Estimate
    from pbrdf.inversion.verdict import Verdict

__all__ = [
    "PAGE",
    "comparison_file",
    "fit_record",
    "parse_formats",
    "write_report",
]

#: Name of the page in the folder of a fit.
PAGE = "index.html"


def write_report(
    report: Report, directory: Path, *, figure_format: str = "png", figures: bool = True
) -> list[Path]:
    """Write the page, the model, the numbers, the comparison, the figures and the summary of a fit, all or nothing.

    Parameters
    ----------
    report
        What is reported on.
    directory
        The folder; made if it is missing.
    figure_format
        ``"png"``, ``"pdf"`` or ``"svg"``, or several of them with commas between.
    figures
        Whether figures are drawn; without them no plotting library is loaded, and the page says so.

    Returns
    -------
    list of Path
        The files, in the order of their importance to a reader.

    Raises
    ------
    DataError
        If the folder cannot be written.
    """
    formats = parse_formats(figure_format)
    with atomic_folder(directory, fill=True) as temporary:
        (temporary / "summary.txt").write_text(summary_text(report), encoding="utf-8")
        report.result.model.to_json(temporary / "model.json")
        record = json.dumps(fit_record(report), indent=2, ensure_ascii=False, allow_nan=False)
        (temporary / "fit.json").write_text(record + "\n", encoding="utf-8")
        write_netcdf_file(temporary / "comparison.nc", {"/": comparison_file(report)})
        write_result(report.result, temporary / FILE_NAME)
        drawn = _write_figures(report, temporary, formats) if figures else {}
        pictures = [f"{name}.{kind}" for name in drawn for kind in formats]
        names = ["summary.txt", *pictures, "model.json", "fit.json", "comparison.nc", FILE_NAME]
        (temporary / PAGE).write_text(page_text(report, drawn, names), encoding="utf-8")
    return [directory / name for name in (PAGE, *names)]


def parse_formats(text: str, option: str = "figure_format") -> list[str]:
    """Formats of figures by name, ``"png"`` or ``"png,pdf"``; ``option`` names what they were given for.

    Raises
    ------
    PbrdfError
        If one of them is not known.
    """
    formats = list(dict.fromkeys(part.strip() for part in text.split(",")))
    if not set(formats) <= set(FIGURE_FORMATS):
        raise PbrdfError(
            f"{option} {text!r}: choose one of {', '.join(FIGURE_FORMATS)}, or several, for example png,pdf"
        )
    return formats


def _write_figures(report: Report, folder: Path, formats: Sequence[str]) -> dict[str, Markup]:
    """Draw and save the figures; returns them as pieces of the page by name."""
    from pbrdf.report.fit.pictures import pictures
    from pbrdf.report.inline_svg import inline_svg
    from pbrdf.report.style import save_figure

    drawn = {}
    for picture in pictures(report):
        files = [f"{picture.name}.{kind}" for kind in formats]
        pixels = folder / f"{picture.name}.png" if "png" in formats else None
        image = inline_svg(picture.figure, picture.alternative, picture.name, pixels)
        for name in files:
            if not name.endswith(".png"):
                save_figure(picture.figure, folder / name)
        drawn[picture.name] = framed(image, picture.caption, files)
    return drawn


def fit_record(report: Report) -> dict[str, Any]:
    """Everything a program may want to know of a fit, in types that JSON has (NaN as None), angles in
    degrees."""
    result = report.result
    factor = {name: shown_unit(e.parameter)[0] for name, e in result.estimates.items()}
    record = {
        "pbrdf": __version__,
        "data": {
            "name": report.name,
            **{
                key: report.dataset.attrs[key]
                for key in ("title", "source", "quantity", "scale", "simulated")
                if key in report.dataset.attrs
            },
            "geometries": report.dataset.sizes["geometry"],
            "held_out_geometries": int(result.comparison["held_out"].values.sum()),
            "sha256": report.sha256 or None,
        },
        "command": report.command or None,
        "settings": dict(report.settings),
        "verdict": verdict_record(result.verdict()),
        "model": result.model.to_dict(),
        "estimates": {name: _estimate(e) for name, e in result.estimates.items()},
        "held_by_wavelength": {
            name: {f"{wavelength:.10g}": value * factor[name] for wavelength, value in table.items()}
            for name, table in result.space.by_wavelength.items()
        },
        "correlation": {
            "parameters": [str(n) for n in result.correlation["parameter"].values],
            "matrix": result.correlation.values,
        },
        "goodness": asdict(result.goodness),
        "optima": [
            {**asdict(o), "values": {name: v * factor[name] for name, v in o.values.items()}}
            for o in result.optima
        ],
        "stages": [asdict(stage) for stage in result.stages],
        "starts": result.starts,
        "converged": result.converged,
        "settled": result.settled,
        "noise": result.noise,
        "uncertainties_from_data": result.std_known,
        "hold_out": None if result.hold_out is None else str(result.hold_out),
        "fitted_errors": {region: asdict(errors) for region, errors in result.fitted.items()},
        "predicted_errors": {region: asdict(errors) for region, errors in result.predicted.items()},
        "notes": result.notes,
        "checks": None if report.checks is None else report.checks.record(result),
    }
    return plain(record)  # type: ignore[return-value]


def verdict_record(verdict: Verdict) -> dict[str, Any]:
    """A verdict in types that JSON has."""
    return {
        "level": str(verdict.level),
        "sentence": verdict.sentence,
        "reasons": verdict.reasons,
        "do_not_quote": verdict.do_not_quote,
        "strata": [{**asdict(s), "fails": s.fails} for s in verdict.strata],
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    factor, unit = shown_unit(estimate.parameter)
    return {
        "value": factor * estimate.value,
        "standard_error": factor * estimate.std,
        "unit": "degree" if unit == "°" else unit,
        "lower": factor * estimate.lower,
        "upper": factor * estimate.upper,
        "verdict": estimate.verdict,
    }


def comparison_file(report: Report) -> xr.Dataset:
    """Measured, modelled and residual values as they stand in the file: angles in degrees, described."""
    result = report.result
    ds = result.comparison.copy()
    for name in ("theta_i", "theta_r", "phi", "facet_tilt"):
        radians = ds[name].values
        degrees = exact_degrees(radians)
        ds[name] = (ds[name].dims, np.rad2deg(radians) if degrees is None else degrees, {"units": "degree"})
    for name in [str(n) for n in ds.data_vars if ds[n].dtype == bool]:
        ds[name] = (
            ds[name].astype(np.int8).assign_attrs(long_name=name.replace("_", " "), flag_values="0 no, 1 yes")
        )
    ds.attrs = {
        "title": f"{result.model.name} fitted to {report.name}",
        "source": f"pbrdf {__version__}",
        "data": str(report.dataset.attrs.get("title", report.name)),
        "model": json.dumps(result.model.to_dict(), ensure_ascii=False),
        "noise": result.noise,
        "hold_out": "" if result.hold_out is None else str(result.hold_out),
        "values": "on the scale of a BRDF; residual = modelled - measured; Q = I_p - I_s; phi = 0 forward",
    }
    return ds
