"""Picture files of one grey channel: PNG, TIFF with one or many pages, NPY.

Only rows that are asked for are read from TIFF files without compression and from NPY files. A PNG file and a page of a
compressed TIFF file can only be decoded whole: one such picture is then in memory at a time.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.picture_checks import require_checksums, require_pages, require_possible

__all__ = ["SUFFIXES", "PictureFile", "open_pictures"]

# what tifffile has to say of a damaged file is said by the error that follows
logging.getLogger("tifffile").addHandler(logging.NullHandler())

SUFFIXES = (".png", ".tif", ".tiff", ".npy")
#: Grey modes of Pillow and what they hold.
_GREY = {"1": "bool", "L": "uint8", "I;16": "uint16", "I;16L": "uint16", "I;16B": "uint16"}
_ONE_CHANNEL = "give pictures of one grey channel with 8 or 16 bits, as the camera reads them out"


@dataclass(frozen=True)
class PictureFile:
    """Pictures of one size in one file.

    Attributes
    ----------
    path
        The file.
    shape
        Its array; the last two dimensions are rows and columns.
    dtype
        Type of the numbers.
    offset
        Where TIFF pages stand in the file, bytes, if rows can be read from there; else empty.
    """

    path: Path
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    offset: tuple[int, ...] = ()

    @property
    def count(self) -> int:
        """Number of pictures."""
        return int(np.prod(self.shape[:-2], dtype=int))

    @property
    def rows(self) -> int:
        return self.shape[-2]

    @property
    def columns(self) -> int:
        return self.shape[-1]

    def read(self, picture: int, first_row: int, last_row: int) -> np.ndarray:
        """Rows of one of the pictures, shape (last_row − first_row, columns).

        Raises
        ------
        DataError
            If the file cannot be read to its end.
        """
        kind = self.path.suffix.lower()
        with _reading(self.path):
            if kind == ".npy":
                array = np.load(self.path, mmap_mode="r", allow_pickle=False)
                index = np.unravel_index(picture, self.shape[:-2])
                return np.array(array[(*index, slice(first_row, last_row))])
            if kind == ".png":
                require_checksums(self.path)
                return _decoded(self.path, 0)[first_row:last_row]
            if self.offset:
                page = np.memmap(self.path, self.dtype, "r", self.offset[picture], self.shape[-2:])
                return np.array(page[first_row:last_row])
            return _tiff_page(self.path, picture)[first_row:last_row]


def open_pictures(path: Path) -> PictureFile:
    """Read what a file holds without its pictures.

    Raises
    ------
    DataError
        If the file cannot be read, or holds colours or anything else than pictures.
    """
    if not path.is_file():
        raise DataError(f"{path}: there is no such file")
    kind = path.suffix.lower()
    with _reading(path):
        if kind == ".npy":
            array = np.load(path, mmap_mode="r", allow_pickle=False)
            if array.ndim < 2 or 0 in array.shape:
                raise DataError(f"{path}: an array of the shape {array.shape} is no picture")
            return PictureFile(path, array.shape, array.dtype)
        if kind in (".png", ".tif", ".tiff"):
            picture = _open_png(path) if kind == ".png" else _open_tiff(path)
            require_possible(path, picture.shape, picture.dtype)
            return picture
    raise DataError(f"{path}: pictures are read from {', '.join(SUFFIXES)} files")


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        yield
    except DataError:
        raise
    except Exception as error:  # decoders raise anything over a damaged file
        # an operating system's error has a number, a library's a sentence of its own
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise DataError(f"{path}: cannot be read as a picture: {reason}") from error


def _open_png(path: Path) -> PictureFile:
    from PIL import Image

    with Image.open(path, formats=("PNG",)) as image:
        if image.mode not in _GREY:
            raise DataError(f"{path}: a colour picture (mode {image.mode}); {_ONE_CHANNEL}")
        return PictureFile(path, (image.height, image.width), np.dtype(_GREY[image.mode]))


def _decoded(path: Path, page: int) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as image:
        image.seek(page)
        return np.asarray(image)


def _open_tiff(path: Path) -> PictureFile:
    import tifffile

    require_pages(path)
    with tifffile.TiffFile(path) as file:
        stack = file.series[0]
        first = stack.keyframe
        kind = tifffile.PHOTOMETRIC(first.photometric)
        if first.samplesperpixel != 1 or kind.name not in ("MINISBLACK", "MINISWHITE"):
            raise DataError(f"{path}: a colour picture ({kind.name}); {_ONE_CHANNEL}")
        if kind.name == "MINISWHITE":
            raise DataError(f"{path}: a negative, in which 0 is white; {_ONE_CHANNEL}")
        kinds = {(s.keyframe.imagelength, s.keyframe.imagewidth, s.keyframe.dtype) for s in file.series}
        if len(kinds) > 1:
            raise DataError(f"{path}: its pages differ in size or type: one file holds pictures of one kind")
        # pages that were written one by one are a series each
        pages = [page for one in file.series for page in one.pages]
        stacked = stack.shape[:-2] if len(file.series) == 1 else (len(pages),)
        shape = (*stacked, first.imagelength, first.imagewidth)
        dtype = np.dtype(first.dtype).newbyteorder(file.byteorder)
        count = int(np.prod(shape[:-2], dtype=int))
        offset: tuple[int, ...] = ()
        if len(file.series) == 1 and stack.dataoffset is not None:
            size = shape[-2] * shape[-1] * dtype.itemsize
            offset = tuple(stack.dataoffset + i * size for i in range(count))
        elif all(page is not None and page.is_memmappable for page in pages):
            offset = tuple(page.dataoffsets[0] for page in pages)  # type: ignore[union-attr]
        return PictureFile(path, shape, dtype, offset)


def _tiff_page(path: Path, page: int) -> np.ndarray:
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            return file.pages[page].asarray()
    except ValueError:
        # compressed in a way that tifffile leaves to other libraries (LZW); Pillow knows most
        return _decoded(path, page)
