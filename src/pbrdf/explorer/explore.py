"""``pbrdf.explore``: the explorer as a widget in notebooks, as a page elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pbrdf.errors import PbrdfError
from pbrdf.explorer.opening import is_map, open_source
from pbrdf.explorer.workspace import Workspace
from pbrdf.models.base import Model

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.explorer.widget import Explorer
    from pbrdf.inversion.result import FitResult

__all__ = ["explore"]


def explore(
    *things: Model | xr.Dataset | FitResult | str | os.PathLike[str],
    **named: Model | xr.Dataset | FitResult | str | os.PathLike[str],
) -> Explorer | None:
    """Look at models beside measured data, and fit them, with sliders.

    In Jupyter and marimo it gives a widget, which shows itself where it is the last value of a cell. Elsewhere it
    serves a page from this machine, opens the browser, prints the address, and comes back at Ctrl-C. As
    ``pbrdf explore`` does on the command line; it needs ``pip install 'pbrdf[explore]'``.

    Parameters
    ----------
    *things
        Models, data sets, fits, maps of parameters, or what they are opened from: names of bundled paints, files,
        folders of fits. Nothing: a page to choose on.
    **named
        The same under names to be shown: ``pbrdf.explore(before=one, after=other)``.

    Returns
    -------
    anywidget.AnyWidget or None
        The widget in a notebook.

    Raises
    ------
    PbrdfError
        If something cannot be opened, or what the explorer needs is not installed.
    """
    workspace = Workspace()
    pairs: Iterable[tuple[str | None, Any]] = [*((None, thing) for thing in things), *named.items()]
    for name, thing in pairs:
        _add(workspace, name, thing)
    if not _in_notebook():
        from pbrdf.explorer.program import show

        show(workspace, 0, True, lambda line: print(line, flush=True))
        return None
    try:
        from pbrdf.explorer.widget import Explorer
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "anywidget":
            raise
        raise PbrdfError("the explorer in a notebook needs anywidget: pip install 'pbrdf[explore]'") from None
    return Explorer(workspace)


def _add(workspace: Workspace, name: str | None, thing: Any) -> None:
    import xarray as xr

    from pbrdf.data.schema import DIMENSION, STOKES_AXES
    from pbrdf.data.validation import validate
    from pbrdf.inversion.result import FitResult

    if isinstance(thing, Model):
        workspace.add_model(name or thing.name, thing)
    elif isinstance(thing, FitResult):
        workspace.add_fit(name or f"{thing.model.name} fitted", thing)
    elif isinstance(thing, xr.Dataset):
        if is_map(thing):
            workspace.add_map(name or "map", thing)
        elif {str(dim) for dim in thing.dims} - {DIMENSION, *STOKES_AXES}:
            from pbrdf.inversion.map_store import DatasetSource

            workspace.pictures.append((name or "data", DatasetSource(thing)))
        else:
            validate(thing, origin=name or "")
            workspace.add_dataset(name or str(thing.attrs.get("title") or "data"), thing)
    elif isinstance(thing, str | os.PathLike):
        open_source(workspace, os.fspath(thing), name=name)
    else:
        raise PbrdfError(
            f"the explorer shows models, data sets, fits, maps, and names of their files, not {type(thing).__name__}"
        )


def _in_notebook() -> bool:
    """Whether this runs in a kernel of Jupyter or in marimo."""
    if "marimo" in sys.modules and sys.modules["marimo"].running_in_notebook():
        return True
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return hasattr(shell, "kernel")
