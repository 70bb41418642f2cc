"""What MODEL stands for on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.errors import PbrdfError

if TYPE_CHECKING:
    from pbrdf.models import Model

__all__ = ["is_paint", "known_wavelength", "open_model", "open_single_model"]


def open_model(source: str) -> Model:
    """A model from a JSON file, the folder of a fit, JSON text, or the name of a bundled paint.

    Raises
    ------
    PbrdfError
        If it is none of these; says what is wrong.
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
        path /= "model.json"
    elif not path.exists() and not path.suffix:
        raise PbrdfError(f"{source}: there is no such file, and no paint of that name: {', '.join(PAINTS)}")
    return load_model(path)


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


def open_single_model(source: str) -> Model:
    """As :func:`open_model`, and its parameters are single numbers, not maps; raises PbrdfError if they are."""
    import numpy as np

    model = open_model(source)
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
