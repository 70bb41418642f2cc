"""``pbrdf explore``: models, data, fits and maps in a browser, with sliders."""

from __future__ import annotations

from typing import Annotated

import typer

from pbrdf.cli.console import warn
from pbrdf.cli.interrupt import end
from pbrdf.cli.options import Backend, with_reading_options
from pbrdf.cli.reading import Reading
from pbrdf.errors import PbrdfError

__all__ = ["explore"]


@with_reading_options
def explore(
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="MODEL|DATA|FIT|MAP",
            help="Models' JSON files, bundled paints' names (their models), files of data, folders of fits, maps of "
            "parameters; none to choose on the page.",
            show_default=False,
        ),
    ] = None,
    *,
    reading: Reading,
    port: Annotated[
        int | None,
        typer.Option(
            help="Port of this machine's own address (127.0.0.1).",
            show_default="any that is free",
            min=1,
            max=65535,
        ),
    ] = None,
    browser: Annotated[
        bool,
        typer.Option("--browser/--no-browser", help="Open the page in the browser, or say its address only."),
    ] = True,
    backend: Backend = None,
) -> None:
    """Look at models beside measured data in a browser, and fit them, until Ctrl-C.

    A paint whose parameters move: `pbrdf explore white`

    Data under the model that was fitted to them: `pbrdf explore paint-fit`
    """
    from pbrdf.explorer.opening import open_source
    from pbrdf.explorer.program import show
    from pbrdf.explorer.workspace import Workspace

    if backend is not None:
        from pbrdf.backend import set_backend

        set_backend(backend)
    workspace = Workspace()
    for source in sources or ():
        open_source(workspace, source, reading.open)
    if (given := reading.stated()) and not workspace.datasets:
        raise PbrdfError(f"--{next(iter(given)).replace('_', '-')} is for files of data, and none is given")
    show(workspace, port or 0, browser, lambda line: print(line, flush=True))
    # kernels that are still at work are not waited for
    warn("the explorer has ended")
    end(0)
