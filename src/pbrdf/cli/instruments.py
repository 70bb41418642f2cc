"""An instrument as named on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.errors import DataError

if TYPE_CHECKING:
    from pbrdf.instruments.polarimeter.instrument import Instrument

__all__ = ["open_instrument"]


def open_instrument(source: str, *, mueller: bool = False, colors: bool = False) -> Instrument:
    """An instrument from its TOML file or the name of a built-in one.

    Parameters
    ----------
    source
        Path or name; a file of that name goes before a built-in instrument.
    mueller
        Take one that measures Mueller matrices too.
    colors
        Take one that sees several colours too.

    Raises
    ------
    DataError
        If there is neither, the file is not understood, or the instrument measures something else.
    """
    from pbrdf.instruments.polarimeter.instrument_files import load_instrument
    from pbrdf.instruments.polarimeter.presets import PRESETS, preset

    path = Path(source)
    if path.exists() or path.suffix:
        instrument = load_instrument(path)
    elif source in PRESETS:
        instrument = preset(source)
    else:
        raise DataError(
            f"{source}: there is no such file, and no built-in instrument of that name: {', '.join(PRESETS)}"
        )
    if not mueller:
        instrument.require_stokes()
    if not colors and instrument.polarimeter.filters is not None:
        raise DataError(
            f"{source}: a camera of several colours; here one colour at a time is meant: take the settings without "
            "colors (sony_imx250mzr is the grey camera)"
        )
    return instrument
