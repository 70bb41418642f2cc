"""What MODEL stands for on the command line."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.cli.console import warn
from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from pbrdf.models import Model

__all__ = ["is_paint", "known_wavelength", "models_at", "open_model", "open_single_model"]


def open_model(source: str, wavelength: float | None = None) -> Model:
    """A model from a JSON file, the folder of a fit, JSON text, or the name of a bundled paint.

    Parameters
    ----------
    source
        What to open.
    wavelength
        nm; chooses among the models of a fit with parameters of each wavelength.

    Raises
    ------
    PbrdfError
        If it is none of these, or a fit with a model of each wavelength and none of them is chosen; says what is wrong.
    """
    from pbrdf.data.paints import PAINTS, load_paint
    from pbrdf.models import load_model

    if is_paint(source):
        return load_paint(source)
    if source.lstrip().startswith("{"):
        return load_model(source)
    path = Path(source)
    if path.exists():
        _refuse_measurements(path)
    if path.is_dir():
        if not (path / "model.json").is_file():
            raise PbrdfError(
                f"{source}: this folder holds no model.json; name the folder of a fit, or a file"
            )
        models = models_at(source, [wavelength])
        if models is not None:
            return models[0]
        path /= "model.json"
    elif not path.exists() and not path.suffix:
        raise PbrdfError(f"{source}: there is no such file, and no paint of that name: {', '.join(PAINTS)}")
    return load_model(path)


def models_at(source: str, wavelengths: Sequence[float | None]) -> list[Model] | None:
    """Models of a fit with parameters free or held for each wavelength; None if the source is no such fit.

    Parameters
    ----------
    source
        Folder of the fit.
    wavelengths
        nm; None where none is chosen.

    Raises
    ------
    PbrdfError
        If none is chosen, or the fit knows one of them not.
    """
    from pbrdf.data.select import WAVELENGTH_TOLERANCE
    from pbrdf.inversion.stored_result import FILE_NAME

    folder = Path(source)
    if not (folder / FILE_NAME).is_file() or not _may_differ(folder):
        return None
    from pbrdf.inversion.stored_result import load_fit

    result = load_fit(folder)
    terms = [term for term in result.space.terms if term.split == "group" and not term.nuisance]
    if terms:
        names = ", ".join(dict.fromkeys(term.role for term in terms))
        warn(f"{source}: {names} of its own in each group: this is the model of the first, {terms[0].label}")
    known = result.models
    if not known:
        return None
    few = ", ".join(f"{one:g}" for one in known)
    models = []
    for wanted in wavelengths:
        if wanted is None:
            first, last = min(known), max(known)
            shown = few if len(known) < 6 else f"{first:g} … {last:g}"
            raise PbrdfError(
                f"{source}: this fit has a model of each of {len(known)} wavelengths, {shown} nm: choose one with "
                f"--wavelength; {folder / 'model.json'} is that of {next(iter(known)):g} nm"
            )
        nearest = min(known, key=lambda one: abs(one - wanted))
        if not abs(nearest - wanted) <= WAVELENGTH_TOLERANCE:
            raise PbrdfError(f"--wavelength {wanted:g}: {source} has parameters at {few} nm")
        models.append(known[nearest])
    return models


def _may_differ(folder: Path) -> bool:
    """Whether parameters of a fit may differ between wavelengths: its record tells that faster than the whole of it."""
    try:
        record = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
        return bool(record["held_by_wavelength"]) or any(name.endswith("]") for name in record["estimates"])
    except (OSError, ValueError, KeyError, TypeError):
        return True


def _refuse_measurements(path: Path) -> None:
    """Raise PbrdfError if this is a file of data: it names the step that makes a model of it."""
    from pbrdf.data.readers import format_of

    if path.suffix.lower() == ".json" or (path / "model.json").is_file():
        return
    name = format_of(path)
    if name is not None:
        kind = path.suffix if path.suffix else name
        raise PbrdfError(
            f"{path}: {kind} tables are measurements, not models; fit them first (pbrdf fit {path}), and give the "
            "folder of the fit"
        )


def open_single_model(source: str, wavelength: float | None = None) -> Model:
    """As :func:`open_model`, and its parameters are single numbers, not maps; raises PbrdfError if they are."""
    import numpy as np

    model = open_model(source, wavelength)
    if any(np.ndim(value) for value in model.values.values()):
        raise PbrdfError(f"{source}: its parameters are arrays; give a model with single numbers")
    return model


def known_wavelength(source: str) -> float | None:
    """Wavelength in nm for which a source of :func:`open_model` is known to hold: that of the bundled paints."""
    from pbrdf.data.paints import WAVELENGTH

    return WAVELENGTH if is_paint(source) else None


def is_paint(source: str) -> bool:
    """Whether this names a bundled paint or its companion for rendering; a file of that name goes before."""
    from pbrdf.data.paints import PAINTS, SCENE_PAINTS

    return (source in PAINTS or source in SCENE_PAINTS) and not Path(source).exists()
