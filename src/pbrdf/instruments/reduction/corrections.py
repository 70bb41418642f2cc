"""Dark frame, flat field and map of dead pixels: what they do to the signal and to its covariance.

Signal = (raw − dark)/response with the response (flat − dark)/mean(flat − dark). Their own noise is taken from the
detector and the number of exposures they are means of. For a mosaic every state has its own pixel, and that noise is
independent between the states. Otherwise one dark frame and one flat field serve all states of a pixel, and their noise
is common to them: that of the dark frame is an intensity added to all states alike, that of the flat field scales the
whole Stokes vector. Both are common to all series too, which the covariance of a single series cannot say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.digital_numbers import require_range, shifted
from pbrdf.instruments.frames.exposures import combine
from pbrdf.instruments.frames.frame_files import open_picture
from pbrdf.instruments.frames.frame_layout import FrameLayout
from pbrdf.instruments.frames.frames import ColorCells, Frames, color_cells_of, require_raw, shift_of
from pbrdf.instruments.frames.mosaic import split_mosaic
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.polarimeter.stokes_solution import solve_stokes
from pbrdf.instruments.reduction.stokes_image import StokesImage, reduce_frames

__all__ = ["Corrections", "PixelLevels", "reduce_rows"]

#: Rows of the flat field that are worked on at a time.
_ROWS = 128


@dataclass(frozen=True, eq=False)
class Corrections:
    """Pictures that correct the frames, in memory as they were read.

    Attributes
    ----------
    dark, flat
        Raw digital numbers, shape (N or 1, rows, columns): N for a mosaic. None where there is no such picture.
    dead
        Which pixels must not be used, bool, shape (rows, columns), or None.
    layout
        Where they come from, and how many exposures they are means of.
    flat_scale
        Mean of the flat field above the dark level, for a mosaic divided by the mean transmittance of its states.
    """

    dark: np.ndarray | None = None
    flat: np.ndarray | None = None
    dead: np.ndarray | None = None
    layout: FrameLayout = field(default_factory=FrameLayout)
    flat_scale: float = 1.0

    @classmethod
    def of(cls, instrument: Instrument, frames: Frames) -> Corrections:
        """Read what the instrument's table ``[frames]`` names.

        Raises
        ------
        DataError
            If a file cannot be read, has another size than the frames, or is a flat field without light.
        """
        layout = FrameLayout.from_table(instrument.frames, instrument.folder)
        read = {
            key: _read(key, getattr(layout, key), instrument, frames)
            for key in ("dark_frame", "flat_field", "dead_pixels")
        }
        dead = None if read["dead_pixels"] is None else (read["dead_pixels"] != 0).any(axis=0)
        stated = layout.flat_transmittance
        if stated is not None and len(stated) != instrument.polarimeter.size:
            raise DataError(
                f"[frames] flat_transmittance holds {len(stated)} numbers for the {instrument.polarimeter.size} states "
                f"of {instrument.polarimeter.name}"
            )
        made = cls(read["dark_frame"], read["flat_field"], dead, layout)
        return made if made.flat is None else replace(made, flat_scale=made._mean_flat(instrument))

    def _mean_flat(self, instrument: Instrument) -> float:
        assert self.flat is not None
        total = weight = 0.0
        height = self.flat.shape[1]
        for first in range(0, height, _ROWS):
            rows = slice(first, min(first + _ROWS, height))
            light = self.flat[:, rows] - self._level(instrument, rows)
            good = (light > 0.0) & ~instrument.detector.saturated(self.flat[:, rows])
            if self.dead is not None:
                good &= ~self.dead[rows]
            total += light[good].sum()
            weight += (self._transmittance(instrument, rows) * good).sum()
        if weight == 0.0:
            raise DataError(
                f"{self.layout.flat_field}: the flat field is nowhere between the dark level and saturation: give it "
                "as the camera reads it out, in digital numbers"
            )
        return float(total / weight)

    def _level(self, instrument: Instrument, rows: slice) -> np.ndarray | float:
        """Digital numbers without light."""
        return instrument.detector.black if self.dark is None else self.dark[:, rows].astype(float)

    def _transmittance(self, instrument: Instrument, rows: slice) -> np.ndarray | float:
        """Of the states for natural light, in the shape of the flat field; 1 where one picture serves all states."""
        polarimeter = instrument.polarimeter
        assert self.flat is not None
        if polarimeter.mosaic is None:
            return 1.0
        if self.layout.flat_transmittance is not None:
            return np.array(self.layout.flat_transmittance)[:, None, None]
        if polarimeter.is_map:
            height, width = self.flat.shape[1:]
            analyzer = polarimeter.spread(height, width, rows.start, rows.stop)
            return np.moveaxis(analyzer[..., 0], -1, 0)
        return polarimeter.analyzer[:, 0, None, None]

    def pixels(self, instrument: Instrument, rows: slice) -> PixelLevels:
        """Level, response and dead pixels of some rows."""
        level = self._level(instrument, rows)
        dead = None if self.dead is None else self.dead[rows]
        if self.flat is None:
            return PixelLevels(level, np.inf, 1.0, dead)
        flat = self.flat[:, rows]
        light = flat - level
        blind = (light <= 0.0) | instrument.detector.saturated(flat)
        light[blind] = 1.0
        dead = np.logical_or(blind.any(axis=0), False if dead is None else dead)
        return PixelLevels(
            level, light, light / (self.flat_scale * self._transmittance(instrument, rows)), dead
        )


@dataclass(frozen=True, eq=False)
class PixelLevels:
    """What stands between the light on some pixels and their numbers.

    Attributes
    ----------
    level
        Digital numbers without light, shape (N or 1, rows, columns), or one number for all.
    light
        Flat field above this level, likewise; infinite without one.
    response
        Of the pixels relative to the mean, likewise: the signal is divided by it.
    dead
        Bool, shape (rows, columns), or None.
    """

    level: np.ndarray | float
    light: np.ndarray | float
    response: np.ndarray | float
    dead: np.ndarray | None

    def part(self, cells: ColorCells) -> PixelLevels:
        """Those of one kind of cell of a colour mosaic."""

        def part(values: np.ndarray | float) -> np.ndarray | float:
            return cells.parts(values)[0] if isinstance(values, np.ndarray) else values

        dead = None if self.dead is None else cells.parts(self.dead)[0]
        return PixelLevels(part(self.level), part(self.light), part(self.response), dead)

    @property
    def black(self) -> np.ndarray | None:
        """The level as :func:`pbrdf.instruments.reduction.stokes_image.reduce_frames` takes it; None: its own."""
        return _of_pixels(self.level) if isinstance(self.level, np.ndarray) else None

    @property
    def flat(self) -> np.ndarray | None:
        """The response as :func:`~pbrdf.instruments.reduction.stokes_image.reduce_frames` takes it."""
        return _of_pixels(self.response) if isinstance(self.response, np.ndarray) else None


def _read(key: str, path: Path | None, instrument: Instrument, frames: Frames) -> np.ndarray | None:
    if path is None:
        return None
    picture = open_picture(path, FrameLayout.from_table(instrument.frames, instrument.folder).raw)
    raw = picture.read(0, 0, picture.rows)
    if key != "dead_pixels":
        exposures = f"{key.split('_')[0]}_exposures"
        what = f"{path}: the {key.replace('_', ' ')}"
        require_raw(raw.dtype, what, means=True)
        if raw.dtype.kind == "f" and exposures not in instrument.frames:
            raise DataError(
                f"{what} holds numbers of the type {raw.dtype}, as means of several exposures are: say of how many in "
                f"[frames], {exposures} = 100"
            )
        try:
            raw = shifted(raw, shift_of(frames))
        except DataError as error:
            raise DataError(f"{path}: {error}") from None
    seen = raw if instrument.polarimeter.mosaic is None else split_mosaic(raw[0], instrument.polarimeter)
    tall, wide = color_cells_of(frames, 0).size
    if seen.shape[1:] != (frames.rows * tall, frames.columns * wide):
        raise DataError(
            f"{path}: {seen.shape[1]} × {seen.shape[2]} pixels (rows × columns), but the frames have "
            f"{frames.rows * tall} × {frames.columns * wide}"
        )
    return seen


def reduce_rows(
    raw: np.ndarray,
    instrument: Instrument,
    corrections: Corrections,
    rows: tuple[int, int, int],
    *,
    cells: ColorCells | None = None,
    dark_level: float = 0.0,
    weighted: bool = True,
) -> StokesImage:
    """Reduce some rows of a series, with what the corrections say of their pixels.

    Parameters
    ----------
    raw
        What :meth:`pbrdf.instruments.frames.frames.Frames.read` gives of these rows.
    instrument, corrections
        What took them.
    rows
        First row, last row (not included), and the number of rows of the whole picture.
    cells
        Which cells of a colour mosaic to reduce; those of one colour are averaged.
    dark_level, weighted
        See :func:`pbrdf.instruments.reduction.stokes_image.reduce_frames`.

    Raises
    ------
    DataError
        If the numbers are not those of the detector's converter.
    """
    require_range(raw, instrument.detector)
    cells = cells or ColorCells()
    tall = cells.size[0]
    first, last, total = (tall * row for row in rows)
    polarimeter = instrument.polarimeter
    analyzer = (
        polarimeter.spread(total, raw.shape[-1], first, last) if polarimeter.is_map else polarimeter.analyzer
    )
    pixels = corrections.pixels(instrument, slice(first, last))
    flat = None if corrections.flat is None else corrections.flat[:, first:last]
    images = []
    for place in cells.places:
        one = ColorCells(cells.size, (place,))
        part = analyzer
        if analyzer.ndim > 2:
            part = np.moveaxis(one.parts(np.moveaxis(analyzer, (2, 3), (0, 1)))[0], (0, 1), (2, 3))
        images.append(
            _reduced(
                one.parts(raw)[0],
                instrument,
                corrections,
                pixels.part(one),
                None if flat is None else one.parts(flat)[0],
                part,
                dark_level,
                weighted,
            )
        )
    return images[0] if len(images) == 1 else _averaged(images)


def _averaged(images: Sequence[StokesImage]) -> StokesImage:
    """The mean of several cells of the same colour; what is wrong with one is wrong with all."""
    flags = np.bitwise_or.reduce([image.flags for image in images])
    count = len(images)
    return StokesImage(
        np.sum([image.stokes for image in images], axis=0) / count,
        np.sum([image.covariance for image in images], axis=0) / count**2,
        flags,
    )


def _reduced(
    raw: np.ndarray,
    instrument: Instrument,
    corrections: Corrections,
    pixels: PixelLevels,
    flat: np.ndarray | None,
    analyzer: np.ndarray,
    dark_level: float,
    weighted: bool,
) -> StokesImage:
    """Stokes parameters of pixels, all alike in colour."""
    detector, polarimeter = instrument.detector, instrument.polarimeter
    reading = combine(raw, detector, corrections.layout.exposures or 1)
    level, light, response = pixels.level, pixels.light, pixels.response
    level_variance: np.ndarray | float = 0.0
    if corrections.dark is not None:
        level_variance = detector.variance(level) / corrections.layout.dark_exposures
    flat_variance: np.ndarray | float = 0.0
    if flat is not None:
        flat_variance = detector.variance(flat) / corrections.layout.flat_exposures
    # The dark frame is taken from the flat field too: what it adds there counts against what it takes here.
    own: np.ndarray | None = None
    independent = polarimeter.mosaic is not None
    if independent and (corrections.dark is not None or flat is not None):
        share = (reading.numbers - level) / light
        own = (level_variance * (1.0 - share) ** 2 + flat_variance * share**2) / np.square(response)
    image = reduce_frames(
        reading,
        polarimeter,
        detector,
        dead=pixels.dead,
        dark_level=dark_level,
        weighted=weighted,
        analyzer=analyzer,
        black=pixels.black,
        flat=pixels.flat,
        extra_variance=own,
    )
    if not independent and corrections.dark is not None:
        taken = _all_states_alike(reading.numbers.shape, 1.0 / np.asarray(response), analyzer)
        _add(image, taken - image.stokes / light, level_variance)
    if not independent and flat is not None:
        _add(image, image.stokes / light, flat_variance)
    return image


def _of_pixels(values: np.ndarray) -> np.ndarray:
    """(1, rows, columns) as (rows, columns)."""
    return values[0] if len(values) == 1 else values


def _all_states_alike(shape: tuple[int, ...], signal: np.ndarray, analyzer: np.ndarray) -> np.ndarray:
    """Stokes parameters of the same signal in all states, shape (4, rows, columns)."""
    through = analyzer[..., 0]
    if np.ptp(through) <= 1e-12 * np.abs(through).max():
        # an intensity, whatever the weights
        added = np.zeros((4, *shape[1:]))
        added[0] = signal / through.flat[0]
        return added
    # weights that differ between the states change this small term little
    return solve_stokes(np.broadcast_to(signal, shape), np.ones(shape), analyzer, weighted=False)[0]


def _add(image: StokesImage, vector: np.ndarray, variance: np.ndarray | float) -> None:
    """Add to the covariance that of a Stokes vector times a random number."""
    spread = np.asarray(variance)[0]
    image.covariance[...] += spread * vector[:, None] * vector[None, :]
