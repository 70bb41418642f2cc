"""The folders that identification leaves behind: of a measurement, of a map, of a calibration."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbrdf.files.atomic import atomic_folder
from pbrdf.report.identification.calibrated import Calibrated, calibration_rests_on
from pbrdf.report.identification.classified import Classified, classes_rest_on, classes_sentence
from pbrdf.report.identification.confusion_table import confusion_record, confusion_sentence
from pbrdf.report.identification.labelled import LabelledReport, labels_rest_on
from pbrdf.report.identification.page import calibration_page, classes_page, labelled_page, page_text
from pbrdf.report.identification.subject import (
    Identified,
    ranked,
    rests_on,
    sentence,
    shown_probability,
)
from pbrdf.report.identification.summary import summary_text
from pbrdf.report.numbers import plain
from pbrdf.version import __version__

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

    from pbrdf.identification.confusion import Confusion

__all__ = ["LIBRARY", "MAP", "write_calibration", "write_classes", "write_identification", "write_labelled"]

#: Names of the map of materials and of a calibrated library in a folder.
MAP, LIBRARY = "materials.nc", "library.json"

#: What each figure shows, for those who do not see it, and how to read it.
_CAPTIONS = {
    "bands": (
        "The measurement over what specimens of each candidate would show.",
        "Points: measured, bars one standard uncertainty. Bands: the middle 95 % of the specimens that the library "
        "expects of a material, at each geometry by itself; where the gain is not known, each scaled to the data. "
        "Lines: the specimen that this measurement makes most likely. The last column is the nearest material outside "
        "the set, if there is one.",
    ),
    "parameters": (
        "The fitted parameters over what specimens of each material have.",
        "Bars: the middle 95 % of the specimens of a material, red where it is not in the set. Line and band: the fit "
        "and its standard error; without a band the fit does not determine the parameter.",
    ),
    "next": (
        "What one reading more is expected to tell, by its geometry.",
        "In the plane of incidence; view angles on the side of the source are negative. Star: the best geometry. "
        "Crosses: measured so far.",
    ),
    "classes": (
        "The material of each pixel and its probability.",
        "The probability is that of the material told, given that it is one of the library. Black: like none of the "
        "materials. Grey: not measured. Shares are of the measured pixels.",
    ),
    "reliability": (
        "How often the most probable material is the true one, by its probability.",
        "On the dotted line probabilities are honest; below it they promise too much. Bars: one standard error.",
    ),
    "confusion": (
        "Which material was told as which.",
        "Told: the most probable material of the set. On the right, how many sets hold the true material, or are empty "
        "where the library has not got it.",
    ),
}


def write_identification(
    report: Identified, directory: Path, *, figure_format: str | None = "png"
) -> list[Path]:
    """Write page, summary, all numbers and the figure of a measurement, all or nothing.

    Parameters
    ----------
    report
        What is reported on.
    directory
        The folder; made if it is missing.
    figure_format
        ``"png"``, ``"pdf"`` or ``"svg"``; None draws nothing.

    Returns
    -------
    list of Path
        The files, in the order of their importance to a reader.

    Raises
    ------
    DataError
        If the folder cannot be written.
    """
    from pbrdf.report.identification.bands_figure import bands_figure
    from pbrdf.report.identification.next_reading import next_figure, next_record
    from pbrdf.report.identification.parameters_figure import parameters_figure

    found = report.found
    record: dict[str, Any] = {
        "data": report.name,
        "verdict": sentence(found),
        "set": found.materials,
        "none_of_these": found.none_of_these,
        "confidence": found.confidence,
        "degrees_of_freedom": found.degrees_of_freedom,
        "gain": "unknown" if found.gain else "known",
        "angle_rad": found.angle,
        "noise": found.noise,
        "calibration": found.calibration,
        "library": report.library,
        "candidates": [
            {
                "material": candidate.name,
                "in_set": candidate.accepted,
                "probability": shown_probability(found, candidate),
                "p_value": candidate.p_value,
                "distance": candidate.distance,
                "scatter": found.library[candidate.name].scatter,
                "most_likely_specimen": candidate.values,
            }
            for candidate in ranked(found)
        ],
        "rests_on": rests_on(report),
    }
    draw: dict[str, Callable[[], Figure]] = {}
    if (fitted := report.fitted) is not None:
        draw["parameters"] = lambda: parameters_figure(found, fitted, Path(report.name).name)
    else:
        draw["bands"] = lambda: bands_figure(report)
    if (following := report.next_measurement) is not None and (data := found.data) is not None:
        record["next_measurement"] = next_record(following, len(found.materials))
        draw["next"] = lambda: next_figure(following, data, "one reading more, in the plane of incidence")
    return _write(report, directory, "identification.json", record, draw, page_text, figure_format)


def write_classes(report: Classified, directory: Path, *, figure_format: str | None = "png") -> list[Path]:
    """Write page, summary, counts, figure and the map itself (``materials.nc``); as :func:`write_identification`."""
    from pbrdf.files.netcdf_files import write_netcdf_file
    from pbrdf.report.identification.class_figure import class_figure

    record: dict[str, Any] = {
        "map": report.name,
        "verdict": classes_sentence(report),
        "confidence": report.confidence,
        "library": report.library,
        "classes": [
            {
                "value": count.value,
                "class": count.name,
                "pixels": count.pixels,
                "share_of_measured": count.share,
                "median_probability": count.confidence,
            }
            for count in report.counts
        ],
        "rests_on": classes_rest_on(report),
    }
    title = f"{Path(report.name).name}: materials at {100.0 * report.confidence:g} %"

    def save(folder: Path) -> list[str]:
        stored = report.found.copy()
        stored["in_set"] = (
            stored["in_set"].astype("int8").assign_attrs(stored["in_set"].attrs, flag="1 is true")
        )
        write_netcdf_file(folder / MAP, {"/": stored})
        return [MAP]

    draw = {"classes": lambda: class_figure(report.found, title)}
    if (labelled := report.labelled) is not None:
        record["labelled"] = {"labels": report.labels, **confusion_record(labelled)}
        draw |= _drawn_tables(
            labelled, f"{Path(report.labels).name}: {labelled.total} labelled pixels", "pixels"
        )
    return _write(report, directory, "classes.json", record, draw, classes_page, figure_format, save)


def write_calibration(
    report: Calibrated, directory: Path, *, figure_format: str | None = "png", with_library: bool = False
) -> list[Path]:
    """Write page, summary, numbers and figures, `with_library` the library too; as :func:`write_identification`."""
    record: dict[str, Any] = {
        "labels": report.name,
        "verdict": confusion_sentence(report.table, "measurements"),
        "confidence": report.table.confidence,
        "library": report.written,
        **confusion_record(report.table),
        "rests_on": calibration_rests_on(report),
    }

    def save(folder: Path) -> list[str]:
        if not with_library:
            return []
        report.library.write(folder / LIBRARY)
        return [LIBRARY]

    title = f"{Path(report.name).name}: {report.table.total} labelled measurements"
    draw = _drawn_tables(report.table, title, "measurements")
    return _write(report, directory, "calibration.json", record, draw, calibration_page, figure_format, save)


def write_labelled(
    report: LabelledReport, directory: Path, *, figure_format: str | None = "png"
) -> list[Path]:
    """Write page, summary, numbers and figures of labelled measurements; as :func:`write_identification`."""
    record: dict[str, Any] = {
        "labels": report.name,
        "verdict": confusion_sentence(report.table, "measurements"),
        "confidence": report.table.confidence,
        "library": report.library,
        **confusion_record(report.table),
        "rests_on": labels_rest_on(report),
    }
    title = f"{Path(report.name).name}: {report.table.total} labelled measurements"
    draw = _drawn_tables(report.table, title, "measurements")
    return _write(report, directory, "labelled.json", record, draw, labelled_page, figure_format)


def _drawn_tables(table: Confusion, title: str, what: str) -> dict[str, Callable[[], Figure]]:
    """Confusion, and reliability where there is any."""
    from pbrdf.report.identification.calibration_figure import confusion_figure, reliability_figure

    draw = {"confusion": lambda: confusion_figure(table, title)}
    if (found := table.reliability) is not None:
        draw["reliability"] = lambda: reliability_figure(found, title, what)
    return draw


def _write(
    report: Any,
    directory: Path,
    numbers: str,
    record: Mapping[str, Any],
    draw: Mapping[str, Callable[[], Figure]],
    page: Callable[..., str],
    figure_format: str | None,
    save: Callable[[Path], list[str]] = lambda folder: [],
) -> list[Path]:
    names = ["index.html", "summary.txt", numbers]
    pieces: dict[str, Markup] = {}
    with atomic_folder(directory, fill=True) as temporary:
        (temporary / "summary.txt").write_text(summary_text(report), encoding="utf-8")
        content = plain({"pbrdf": __version__, **record, "settings": dict(report.settings)})
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        (temporary / numbers).write_text(text + "\n", encoding="utf-8")
        names += save(temporary)
        if figure_format is not None:
            from pbrdf.report.inline_svg import inline_svg
            from pbrdf.report.page import figure
            from pbrdf.report.style import save_figure

            for name, make in draw.items():
                made = make()
                drawn = f"{name}.{figure_format}"
                picture = temporary / drawn if figure_format == "png" else None
                names.append(drawn)
                shown, caption = _CAPTIONS[name]
                alternative = f"{shown} {record['verdict']}"
                pieces[name] = figure(inline_svg(made, alternative, name, picture), caption, [drawn])
                if picture is None:
                    save_figure(made, temporary / drawn)
        (temporary / "index.html").write_text(page(report, pieces, names[1:]), encoding="utf-8")
    return [directory / name for name in names]
