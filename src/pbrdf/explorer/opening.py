"""What a source is - a model, data, a fit, a map - and its way into a workspace."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pbrdf.data.paints import PAINTS, load_paint
from pbrdf.data.readers import read
from pbrdf.errors import DataError, PbrdfError
from pbrdf.explorer.workspace import Workspace
from pbrdf.models.registry import load_model

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.map_store.picture_source import PictureSource

__all__ = ["is_map", "open_source"]

#: Variables that maps of parameters have and no other data.
_OF_MAPS = {"estimate", "standard_error", "flags", "status", "chi2", "degrees_of_freedom"}
#: Variables that maps of materials have; their probabilities of each material are not shown.
_OF_MATERIALS = ("material", "confidence")


def open_source(
    workspace: Workspace,
    source: str,
    read: Callable[[str], xr.Dataset] = read,
    name: str | None = None,
) -> None:
    """Open what a name or a path stands for.

    Parameters
    ----------
    workspace
        Where it is opened.
    source
        Name of a bundled paint, a model's JSON file, the folder of a fit, a map, the data of its pixels, or a
        file of data.
    read
        Reads data.
    name
        What it is called; None for the name of the file.

    Raises
    ------
    PbrdfError
        If it is none of these; says what is wrong.
    """
    path = Path(source)
    if not path.exists():
        if source in PAINTS:
            workspace.add_model(name or source, load_paint(source))
            return
        names = "" if path.suffix else f", and no paint of that name: {', '.join(PAINTS)}"
        raise PbrdfError(f"{source}: there is no such file{names}")
    name = name or path.resolve().name
    if _is_fit(path):
        from pbrdf.inversion.stored_result import load_fit

        workspace.add_fit(name, load_fit(path))
    elif (path / "model.json").is_file():
        workspace.add_model(name, load_model(path / "model.json"))
    elif path.suffix.lower() == ".json":
        workspace.add_model(name.removesuffix(".json"), load_model(path))
    elif (found := _map(path)) is not None:
        workspace.add_map(name, found, path.resolve().parent)
    elif (pixels := _pixels(path)) is not None:
        workspace.pictures.append((name, pixels))
    else:
        workspace.add_dataset(name, read(source))


def is_map(dataset: xr.Dataset) -> bool:
    """Whether this is a map of parameters (:func:`pbrdf.fit_map`, ``pbrdf map``) or of materials (``identify``)."""
    names = {str(variable) for variable in dataset.data_vars}
    return names >= _OF_MAPS or (names >= {*_OF_MATERIALS} and "material_name" in dataset.coords)


def _is_fit(path: Path) -> bool:
    from pbrdf.inversion.stored_result import FILE_NAME

    return path.name == FILE_NAME or (path / FILE_NAME).is_file()


def _map(path: Path) -> xr.Dataset | None:
    """The map in a store or a file, None if something else is in it."""
    if path.is_dir():
        from pbrdf.inversion import map_store

        return map_store.open_map(path, partial=True) if map_store.is_map(path) else None
    if path.suffix.lower() != ".nc":
        return None
    from pbrdf.files.netcdf_files import open_netcdf

    found = open_netcdf(path)
    if is_map(found):
        return (found[[*_OF_MATERIALS]].assign_coords(found.coords) if "material" in found else found).load()
    found.close()
    return None


def _pixels(path: Path) -> PictureSource | None:
    """Data that were measured at every pixel of an image, None if something else is there."""
    if not path.is_dir() and path.suffix.lower() not in (".nc", ".nc4"):
        return None
    from pbrdf.inversion.map_store.picture_source import PictureSource

    try:
        return PictureSource.open([path])
    except DataError:
        return None
