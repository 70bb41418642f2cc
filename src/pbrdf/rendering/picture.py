"""Pictures of Stokes vectors, and their OpenEXR files.

The axes of a pixel belong to its line of sight: x lies across it, horizontal in the camera's frame, to the right of
the picture; y is up; x, y and the direction in which the light travels, into the camera, are right-handed. The angle of
linear polarisation is 0° along x and grows counterclockwise as the picture is seen; V > 0 is left circular light
(docs/conventions.md). These are the axes of the instruments too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.files.atomic import atomic_file
from pbrdf.optics.angles import within_half_turn
from pbrdf.optics.elements import diattenuator
from pbrdf.optics.stokes import aolp, dolp

__all__ = ["StokesPicture", "polarizer_name", "read_exr", "read_exr_colors", "write_exr"]

#: Layers of Mitsuba's ``stokes`` integrator, ``S0.R`` and so on.
_COLORS = ("R", "G", "B")

_CONVENTION = (
    "S0..S3 = I, Q, U, V; Q > 0 horizontal, U > 0 at +45 deg, V > 0 left circular (counterclockwise for the camera); "
    "AoLP in degrees, 0 horizontal, counterclockwise as the picture is seen"
)


@dataclass(frozen=True)
class StokesPicture:
    """A rendered picture.

    Attributes
    ----------
    stokes
        I, Q, U, V, shape (4, rows, columns), rows from the top; axes as in the module's docstring.
    std
        Standard errors of the means over the samples, the same shape; NaN where one pass alone tells nothing of them.
    attrs
        What was rendered, and how.
    surface
        Which pixels show a surface and not what is behind all of them, the sky for instance; shape (rows, columns),
        None where that is not known.
    """

    stokes: np.ndarray
    std: np.ndarray
    attrs: Mapping[str, str | float] = field(default_factory=dict)
    surface: np.ndarray | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.stokes.shape[1], self.stokes.shape[2]

    @property
    def dolp(self) -> np.ndarray:
        """Degree of linear polarisation; NaN where there is no light."""
        values: np.ndarray = dolp(np.moveaxis(self.stokes, 0, -1))
        return values

    @property
    def aolp(self) -> np.ndarray:
        """Angle of linear polarisation, radians, within (−π/2, π/2]; NaN where there is no light."""
        return np.where(self.stokes[0] > 0.0, aolp(np.moveaxis(self.stokes, 0, -1)), np.nan)

    def through_polarizer(self, angle: float) -> np.ndarray:
        """Intensity behind a perfect linear polariser before the camera, ½ (I + Q cos2α + U sin2α).

        Parameters
        ----------
        angle
            Of its axis, radians: 0 horizontal, counterclockwise as the picture is seen.

        Returns
        -------
        ndarray
            Shape (rows, columns).
        """
        return np.tensordot(diattenuator(angle)[0], self.stokes, axes=1)


def write_exr(picture: StokesPicture, path: Path, polarizers: Sequence[float] = ()) -> None:
    """Write a picture as one OpenEXR file with a layer for each quantity, single precision.

    Layers: ``S0.Y`` … ``S3.Y``, their standard errors ``S0.std`` … ``S3.std`` where they are known, ``DoLP.Y``,
    ``AoLP.Y`` (degrees), and ``polarizer_30.Y`` for a polariser at 30°.

    Parameters
    ----------
    picture
        What to write.
    path
        The file; it appears complete or not at all.
    polarizers
        Angles of polarisers, radians.

    Raises
    ------
    DataError
        If the file cannot be written.
    """
    import mitsuba as mi

    layers = {f"S{i}.Y": picture.stokes[i] for i in range(4)}
    if np.isfinite(picture.std).any():
        layers |= {f"S{i}.std": picture.std[i] for i in range(4)}
    # in single precision, which rounds what lies beside −90° to it
    angle = within_half_turn(np.rad2deg(picture.aolp).astype(np.float32), 90.0)
    layers |= {"DoLP.Y": picture.dolp, "AoLP.Y": angle}
    layers |= {f"{polarizer_name(a)}.Y": picture.through_polarizer(a) for a in polarizers}
    values = np.ascontiguousarray(np.stack(list(layers.values()), axis=-1), dtype=np.float32)
    bitmap = mi.Bitmap(values, pixel_format=mi.Bitmap.PixelFormat.MultiChannel, channel_names=list(layers))
    header = bitmap.metadata()
    for name, value in {**picture.attrs, "convention": _CONVENTION}.items():
        header[name] = value
    with atomic_file(path) as target:
        try:
            bitmap.write(str(target), mi.Bitmap.FileFormat.OpenEXR)
        except RuntimeError as error:
            raise DataError(f"{path}: cannot be written: {' '.join(str(error).split())}") from error


def polarizer_name(angle: float) -> str:
    """Name of the view through a polariser at this angle, radians."""
    return f"polarizer_{np.round(np.rad2deg(angle), 3):g}"


def read_exr(path: Path) -> StokesPicture:
    """Read a picture that :func:`write_exr` wrote, or one of Mitsuba's without colours.

    Raises
    ------
    DataError
        If the file cannot be read, lacks the layers, or has several colours (:func:`read_exr_colors`).
    """
    colors = read_exr_colors(path)
    if len(colors) > 1:
        raise DataError(
            f"{path}: it has the colours {', '.join(colors)}, each with its own Stokes vectors: "
            "pbrdf.rendering.picture.read_exr_colors reads them apart"
        )
    return next(iter(colors.values()))


def read_exr_colors(path: Path) -> dict[str, StokesPicture]:
    """Read a Stokes picture, each colour apart.

    Two kinds of files: those of :func:`write_exr`, and those of Mitsuba's integrator ``stokes`` with the layers
    ``S0.R``, ``S0.G``, ``S0.B`` … ``S3.B``. Mitsuba's axes are those of the picture, as ours, but its S3 is positive
    for right circular light: the sign is changed here.

    Returns
    -------
    dict of str to StokesPicture
        By the name of the colour, ``"R"``, ``"G"``, ``"B"``; ``""`` alone where there is one, or where Mitsuba has put
        a single wavelength into all three alike.

    Raises
    ------
    DataError
        If the file cannot be read or lacks the layers.
    """
    import mitsuba as mi

    try:
        bitmap = mi.Bitmap(str(path))
        names = [channel.name for channel in bitmap.struct_()]
        metadata: Any = bitmap.metadata()
        header = {name: metadata[name] for name in metadata}
        values = np.array(bitmap, dtype=float)
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: a name or a text in its header is damaged: {error}") from error
    except (RuntimeError, ValueError, MemoryError) as error:
        raise DataError(f"{path}: cannot be read as a picture: {' '.join(str(error).split())}") from error
    if {f"S{i}.{color}" for i in range(4) for color in _COLORS} <= set(names):
        return _mitsuba_colors(names, values, header)
    missing = [f"S{i}.Y" for i in range(4) if f"S{i}.Y" not in names]
    if missing:
        raise DataError(f"{path}: there is no layer {missing[0]}; the file has {', '.join(names)}")
    stokes = np.stack([values[..., names.index(f"S{i}.Y")] for i in range(4)])
    std = np.full_like(stokes, np.nan)
    if all(f"S{i}.std" in names for i in range(4)):
        std = np.stack([values[..., names.index(f"S{i}.std")] for i in range(4)])
    return {"": StokesPicture(stokes, std, header)}


def _mitsuba_colors(
    names: Sequence[str], values: np.ndarray, attrs: dict[str, Any]
) -> dict[str, StokesPicture]:
    """Pictures of Mitsuba's layers in this project's convention."""
    found = {}
    for color in _COLORS:
        stokes = np.stack([values[..., names.index(f"S{i}.{color}")] for i in range(4)])
        stokes[3] *= -1.0
        found[color] = StokesPicture(stokes, np.full_like(stokes, np.nan), attrs)
    first, *others = (picture.stokes for picture in found.values())
    if all(np.array_equal(first, other, equal_nan=True) for other in others):
        return {"": found["R"]}
    return found
