"""What is shown as a figure, as numbers, as a model's file, and as the command that makes the same.

Requests are ``{type: "export", what, format, state}``; the answer ``{type: "exported", name, media, command, note}``
has the file as its one buffer. Nothing is written on this machine: the browser keeps the file where its reader wants
it. Figures are those of ``pbrdf plot``, with the measured data that are chosen, and tables those of ``pbrdf
simulate``; ``fit`` has no file but the ``pbrdf fit`` that begins where the sliders stand. The commands name the
models' files as the page saves them, and data by their names.
"""

from __future__ import annotations

import logging
import re
import shlex
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbrdf.data.build import make_dataset
from pbrdf.data.formats.csv_table.writing import csv_text
from pbrdf.data.paints import PAINTS, WAVELENGTH, load_paint
from pbrdf.data.schema import NATURAL_LIGHT
from pbrdf.errors import PbrdfError
from pbrdf.explorer.fitting import job_of
from pbrdf.explorer.points import Choice, chosen_data
from pbrdf.explorer.session import Emit
from pbrdf.explorer.state import Layer, State, StateError, read_state
from pbrdf.explorer.workspace import Workspace
from pbrdf.version import __version__

__all__ = ["FIGURES", "TABLES", "Export", "answer", "export"]

#: Figures by name, with the ``--kind`` of ``pbrdf plot``; None for its overview of one model.
FIGURES = {
    "overview": None,
    "curves": "curves",
    "hemisphere": "hemisphere",
    "surface": "surface",
    "mueller": "mueller",
}
#: Tables of the active model: viewing angles in the plane of incidence; zenith angles and azimuths (first, last, step).
TABLES = {"plane": ((-85.0, 85.0, 1.0), None), "directions": ((0.0, 85.0, 5.0), (0.0, 360.0, 15.0))}
_MEDIA = {
    "png": "image/png",
    "svg": "image/svg+xml",
    "pdf": "application/pdf",
    "csv": "text/csv",
    "json": "application/json",
}
# Matplotlib's settings belong to the process
_drawing = threading.Lock()
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Export:
    """A file to keep.

    Attributes
    ----------
    name
        Of the file.
    media
        Its media type.
    content
        Its bytes; None for a command alone.
    command
        Command line that makes the same of the models' files; None where there is none.
    note
        What of the present view is not in it, in words; empty for nothing.
    """

    name: str
    media: str
    content: bytes | None
    command: str | None = None
    note: str = ""


def answer(
    request: Mapping[str, Any], buffers: Sequence[Any], workspace: Workspace, emit: Emit
) -> threading.Thread:
    """Begin to make the file; the answer comes when it is made, while pictures are drawn."""

    def work() -> None:
        head = {"id": request.get("id")}
        try:
            made = export(request, workspace)
        except PbrdfError as error:
            place = error.place if isinstance(error, StateError) else ""
            emit({"type": "error", "about": "export", "place": place, "text": str(error), **head}, [])
        except Exception:
            _log.exception("the explorer could not export")
            text = "an error of the explorer; the terminal says more"
            emit({"type": "error", "about": "export", "place": "", "text": text, **head}, [])
        else:
            about = {"name": made.name, "media": made.media, "command": made.command, "note": made.note}
            emit({"type": "exported", **about, **head}, [] if made.content is None else [made.content])

    thread = threading.Thread(target=work, daemon=True, name="pbrdf export")
    thread.start()
    return thread


def export(request: Mapping[str, Any], workspace: Workspace) -> Export:
    """Make the file that a request asks for.

    Raises
    ------
    PbrdfError
        If the state cannot be shown, or there is no such file of it.
    """
    state = read_state(request.get("state"))
    what, kind = str(request.get("what")), str(request.get("format"))
    if what == "model":
        layer = state.shown
        text = layer.model.to_json()
        return Export(_file_names([layer])[0], _MEDIA["json"], text.encode())
    if what in TABLES:
        return _table(state, what)
    if what in FIGURES:
        return _figure(state, workspace, what, kind)
    if what == "fit":
        return _fit(state, workspace)
    raise PbrdfError(f"there is no export {what[:40]!r}")


def _figure(state: State, workspace: Workspace, what: str, kind: str) -> Export:
    from pbrdf.report.model.figure import model_figure
    from pbrdf.report.style import FIGURE_FORMATS, figure_bytes
    from pbrdf.report.together.curves import curves_figure, mueller_figure
    from pbrdf.report.together.hemispheres import hemispheres_figure, surfaces_figure
    from pbrdf.report.together.source import Source

    if kind not in FIGURE_FORMATS:
        raise PbrdfError(f"figures are made as {', '.join(FIGURE_FORMATS)}")
    theta_i: float | None = _angle(state)
    light = state.light.stokes
    alone = what == "overview"
    choice = None if alone else chosen_data(state, workspace)
    layers = [state.shown] if alone else [layer for layer in state.layers if layer.shown] or [state.shown]
    sources = _sources(layers)
    notes = []
    if state.part != "total":
        notes.append("it shows all light of the models, not a part")
    if state.compare is not None:
        notes.append("it shows the models, not their difference")
    if alone and light != NATURAL_LIGHT:
        notes.append("it is drawn in natural light")
    incident = None if what in ("overview", "mueller") or light == NATURAL_LIGHT else light
    drawn = [Source(source, model=layer.model) for source, layer in zip(sources, layers, strict=True)]
    if choice is not None:
        measured = Source(choice.measured.name, dataset=choice.measured.dataset)
        if what == "mueller" and not any(measured.channel(f"m{i}{j}") for i in range(4) for j in range(4)):
            choice = None
        else:
            drawn.append(measured)
            sources.append(measured.name)
            if what != "mueller" and not np.allclose(choice.measured.light, light):
                notes.append("it is drawn in the light of the data")
            notes += _switched_off(choice)
            # the data's own lines and light
            incident, theta_i = None, theta_i if what in ("hemisphere", "surface") else None
    with _drawing:
        if alone:
            figure = model_figure(layers[0].model, state.light.theta_i, sources[0])
        elif what == "mueller":
            figure = mueller_figure(drawn, theta_i)
        else:
            draw: Callable[..., Any] = {
                "curves": curves_figure,
                "hemisphere": hemispheres_figure,
                "surface": surfaces_figure,
            }[what]
            figure = draw(drawn, theta_i, incident)
        content = figure_bytes(figure, kind)
    name = f"{_slug(state.shown.name)}-{what}.{kind}"
    words = ["pbrdf", "plot", *sources]
    if FIGURES[what] is not None:
        words += ["--kind", str(FIGURES[what])]
    if theta_i is not None:
        words += ["--theta-i", f"{theta_i:.10g}"]
    words += [*_incident(incident), *_selected(choice), "--output", name]
    return Export(name, _MEDIA[kind], content, shlex.join(words), "; ".join(notes))


def _fit(state: State, workspace: Workspace) -> Export:
    """The command that fits what the page fits, from where the sliders stand."""
    job, choice = job_of(state, workspace), chosen_data(state, workspace)
    assert choice is not None
    [file] = _file_names([state.shown])
    words = ["pbrdf", "fit", choice.measured.name, "--model", file, "--starts", str(job["starts"])]
    for name, value in job["fix"].items():
        words += ["--fix", f"{name}={float(value)!r}"]
    for name in job["free"]:
        words += ["--free", name]
    if job["hold_out"] is not None:
        words += ["--hold-out", f"{job['hold_out'].kind}={','.join(job['hold_out'].values)}"]
    notes = [*_switched_off(choice), f"save the model file, {file}, beside the data"]
    if any(result.dataset is choice.measured.whole for _, result in workspace.fits):
        notes.append(f"{choice.measured.name} is a fit: name the file of its data instead")
    return Export("", "", None, shlex.join([*words, *_selected(choice)]), "; ".join(notes))


def _selected(choice: Choice | None) -> list[str]:
    wavelength = None if choice is None else choice.measured.wavelength
    return [] if wavelength is None else ["--select", f"wavelength={wavelength:.10g}"]


def _switched_off(choice: Choice) -> list[str]:
    return ["points that are switched off are in it"] if choice.off.any() else []


def _table(state: State, what: str) -> Export:
    """Stokes vectors of the active model at the directions that ``pbrdf simulate`` takes."""
    layer, theta_i, light = state.shown, _angle(state), state.light.stokes
    zeniths, azimuths = TABLES[what]
    [source] = _sources([layer])
    if azimuths is None:
        x = _steps(zeniths)
        theta_r, phi = np.abs(x), np.where(x < 0.0, 180.0, 0.0)
        where = ["--plane"]
    else:
        theta_r, phi = (a.ravel() for a in np.meshgrid(_steps(zeniths), _steps(azimuths), indexing="ij"))
        where = ["--theta-r", _range(zeniths), "--phi", _range(azimuths)]
    angles = [np.deg2rad(a) for a in (np.full_like(theta_r, theta_i), theta_r, phi)]
    stokes = np.asarray(layer.model.stokes(*angles, incident=light, part=state.part))
    columns: dict[str, Any] = {name: stokes[:, i] for i, name in enumerate("IQUV")}
    dataset = make_dataset(
        *angles,
        quantity="brdf",
        **columns,
        wavelength=WAVELENGTH if source in PAINTS else None,
        group=np.full(len(theta_r), round(theta_i)),
        illumination=light,
        simulated=True,
        attrs={
            "title": f"Simulation with {source} (model {layer.model.name})",
            "source": f"SIMULATED by pbrdf {__version__}: {layer.model!r}, without noise",
        },
    )
    name = f"{_slug(layer.name)}-{what}.csv"
    incident = None if light == NATURAL_LIGHT else light
    words = ["pbrdf", "simulate", source, "--theta-i", f"{theta_i:.10g}", *where, *_incident(incident)]
    command = shlex.join([*words, "--output", name]) if state.part == "total" else None
    note = "" if command else f"it holds the {state.part} part alone, which no command writes"
    return Export(name, _MEDIA["csv"], csv_text(dataset).encode(), command, note)


def _angle(state: State) -> float:
    if state.light.theta_i >= 90.0:
        raise StateError("light.theta_i", "figures and tables are made for angles of incidence below 90°")
    return state.light.theta_i


def _sources(layers: Sequence[Layer]) -> list[str]:
    """What a command calls the models: a bundled paint as it is, others by the files that the page saves."""
    files = _file_names(layers)
    return [
        layer.name if layer.name in PAINTS and layer.model == load_paint(layer.name) else file
        for layer, file in zip(layers, files, strict=True)
    ]


def _file_names(layers: Sequence[Layer]) -> list[str]:
    """A file name for each model, no two alike."""
    found: list[str] = []
    for layer in layers:
        stem = _slug(layer.name)
        names = (f"{stem}{'' if i == 1 else f'-{i}'}.json" for i in range(1, len(layers) + 1))
        found.append(next(name for name in names if name not in found))
    return found


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", name.removesuffix(".json").lower()).strip("-") or "model"


def _incident(light: Sequence[float] | None) -> list[str]:
    return [] if light is None else ["--incident", ",".join(repr(float(s)) for s in light)]


def _steps(ends: tuple[float, float, float]) -> np.ndarray:
    first, last, step = ends
    return np.linspace(first, last, round((last - first) / step) + 1)


def _range(ends: tuple[float, float, float]) -> str:
    return ":".join(f"{end:g}" for end in ends)
