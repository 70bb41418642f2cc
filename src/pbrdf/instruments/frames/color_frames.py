"""Pictures of a colour polarisation camera: for each picture one series of frames a colour, never mixed."""

from __future__ import annotations

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ColorCells, Frames, layers_of, notes_of, shift_of
from pbrdf.instruments.frames.mosaic import MosaicFrames
from pbrdf.instruments.polarimeter.polarimeter import Polarimeter

__all__ = ["ColorFrames", "bayer_note"]

#: Cells of a period that differ from their mean by this share, in so many of the periods, are of several colours.
_CONTRAST, _AGREEING, _FEWEST = 0.05, 0.9, 8
#: Rows of a picture that are looked at.
_ROWS = 256


class ColorFrames:
    """Pictures of a mosaic of polarisers under a mosaic of colours, one series a picture and colour.

    Parameters
    ----------
    pictures
        The raw pictures as frames with one state.
    polarimeter
        With a mosaic and colour filters.

    Attributes
    ----------
    sources
        For each series the name of the picture, that of the colour, and its wavelength (nm) if it is known; empty if
        one colour alone is used, and series are called as pictures.

    Raises
    ------
    DataError
        If there are no colours, or the pictures are not made of whole periods of them.
    """

    def __init__(self, pictures: Frames, polarimeter: Polarimeter) -> None:
        filters = polarimeter.filters
        if filters is None:
            raise DataError(f"{polarimeter.name} has no colours")
        self._mosaic = MosaicFrames(pictures, polarimeter)
        tall, wide = filters.size
        if self._mosaic.rows % tall or self._mosaic.columns % wide:
            raise DataError(
                f"a picture of {pictures.rows} × {pictures.columns} pixels is not made of whole periods of "
                f"{tall} × {wide} cells of colours"
            )
        self._cells = [ColorCells((tall, wide), places) for places in filters.places.values()]
        self.sources: tuple[tuple[str, str, float | None], ...] = tuple(
            (name, color, filters.wavelength(color)) for name in pictures.names for color in filters.places
        )
        self.names = tuple(f"{name}_{color}" for name, color, _ in self.sources)
        if filters.only is not None:
            self.names, self.sources = pictures.names, ()
        self.states = polarimeter.size
        self.rows, self.columns = self._mosaic.rows // tall, self._mosaic.columns // wide
        self.layers = tall * wide * layers_of(pictures)
        self.shift = shift_of(pictures)

    def color_cells(self, series: int) -> ColorCells:
        """Which cells the series is made of."""
        return self._cells[series % len(self._cells)]

    @property
    def notes(self) -> list[str]:
        """Of the pictures."""
        return notes_of(self._mosaic.pictures)

    def read(self, series: int, first_row: int, last_row: int) -> np.ndarray:
        tall = self._cells[0].size[0]
        return self._mosaic.read(series // len(self._cells), first_row * tall, last_row * tall)


def bayer_note(pictures: Frames, polarimeter: Polarimeter, black: float) -> list[str]:
    """Whether pictures of a grey mosaic look like those of a colour camera: a sentence that says so, or none.

    Under a Bayer pattern neighbouring cells of polarisers differ in brightness by the same factor all over the picture,
    which nothing in a scene does.

    Parameters
    ----------
    pictures
        As frames with one state.
    polarimeter
        With a mosaic.
    black
        What the pictures read without light.
    """
    mosaic, analyzer = polarimeter.mosaic, polarimeter.mean_analyzer
    assert mosaic is not None
    tall, wide = mosaic.shape
    if tall % 2 or wide % 2:
        return []
    # each 2 × 2 pixels must see light alike, whatever its polarisation
    sums = [
        analyzer[mosaic[y : y + 2, x : x + 2].ravel()].sum(axis=0)
        for y in range(0, tall, 2)
        for x in range(0, wide, 2)
    ]
    if not np.allclose(sums, sums[0], atol=1e-6):
        return []
    high = min(_ROWS, pictures.rows) // 4 * 4
    width = pictures.columns // 4 * 4
    if not high or not width:
        return []
    first = (pictures.rows - high) // 8 * 4
    picture = pictures.read(0, first, first + high)[..., 0, :, :width].astype(float)
    picture = picture.mean(axis=0) if picture.ndim == 3 else picture
    cells = (picture - black).reshape(high // 4, 2, 2, width // 4, 2, 2).sum(axis=(2, 5))
    cells = np.moveaxis(cells, 2, 1).reshape(-1, 4)
    mean = cells.mean(axis=1)
    lit = (mean > 0.0) & (mean >= np.median(mean))
    if lit.sum() < _FEWEST:
        return []
    apart = cells[lit] / mean[lit, None] - 1.0
    middle = np.median(apart, axis=0)
    strongest = int(np.argmax(np.abs(middle)))
    agreeing = (np.sign(apart[:, strongest]) == np.sign(middle[strongest])).mean()
    if abs(middle[strongest]) < _CONTRAST or agreeing < _AGREEING:
        return []
    shown = " : ".join(f"{1.0 + share:.2f}" for share in middle)
    return [
        f"neighbouring cells of polarisers alternate in brightness all over the picture ({shown} in 2 × 2 cells), as "
        "under the colours of a Bayer mosaic: colours are mixed in one degree of polarisation. For a colour camera "
        'use the preset sony_imx250myr, or colors = [["R", "G"], ["G", "B"]] in [polarimeter] with the layout of a '
        "2 × 2 cell"
    ]
