"""``pbrdf polarimeter``: what an instrument is, and how good it can be."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from pbrdf.cli.console import output_console
from pbrdf.cli.instruments import open_instrument
from pbrdf.cli.options import output_option, seed_option
from pbrdf.cli.values import angles, number, require_folder_of
from pbrdf.errors import PbrdfError

__all__ = ["polarimeter"]


def polarimeter(
    source: Annotated[
        str | None,
        typer.Argument(metavar="[FILE|NAME]", help="The instrument's TOML file, or a built-in instrument."),
    ] = None,
    search: Annotated[
        int | None,
        typer.Option(help="Search the best retardances of so many states instead.", metavar="STATES", min=4),
    ] = None,
    limits: Annotated[
        str, typer.Option(help="With --search: range of every retarder, degrees.", metavar="LEAST:LARGEST")
    ] = "0:360",
    axes: Annotated[
        str, typer.Option(help="With --search: fast axes of the retarders, degrees.", metavar="A,B,…")
    ] = "0,45",
    starts: Annotated[int, typer.Option(help="With --search: random starts.", min=1)] = 24,
    seed: Annotated[int, seed_option("With --search: seed of the starts.")] = 0,
    output: Annotated[
        Path | None, output_option("With --search: TOML file for the instrument found.")
    ] = None,
) -> None:
    """Describe a polarimeter: analyser vectors, what they measure, figures of merit, accuracy.

    `pbrdf polarimeter paper`

    The best set that retarders of limited range can do: `pbrdf polarimeter --search 4 --limits 0:180`
    """
    if (source is None) == (search is None):
        raise PbrdfError("give an instrument, or --search with the number of states")
    if search is None:
        if output is not None:
            raise PbrdfError("--output belongs to --search")
        from pbrdf.report.instrument.polarimeter_summary import print_polarimeter

        assert source is not None
        print_polarimeter(open_instrument(source, colors=True), output_console())
        return
    if output is not None:
        if output.suffix.lower() != ".toml":
            raise PbrdfError(f"--output {output}: the extension must be .toml")
        require_folder_of(output)
    import numpy as np

    from pbrdf.instruments.polarimeter.instrument import Instrument
    from pbrdf.instruments.polarimeter.instrument_files import save_instrument
    from pbrdf.instruments.polarimeter.retardance_search import search_retardances
    from pbrdf.report.instrument.polarimeter_summary import merit_table, vector_table

    ends = [number(part, "--limits") for part in limits.split(":")]
    if len(ends) != 2 or ends[0] >= ends[1]:
        raise PbrdfError(f"--limits {limits!r}: give LEAST:LARGEST, for example 0:180")
    found = search_retardances(
        search,
        limits=(math.radians(ends[0]), math.radians(ends[1])),
        axes=[math.radians(a) for a in angles(axes, "--axes")],
        starts=starts,
        seed=seed,
    )
    print(f"Retardances of the retarders at {axes}°, in the order the light meets them:")
    for name, row in zip(found.polarimeter.states, np.rad2deg(found.retardances), strict=True):
        print(f"  {name}: {', '.join(f'{delta:.3f}°' for delta in row)}")
    print(f"{found.agreeing} of {found.starts} starts ended at this value.\n")
    console = output_console()
    console.print(vector_table(found.polarimeter))
    console.print(merit_table({f"best within {ends[0]:g}…{ends[1]:g}°": found.polarimeter}))
    if output is not None:
        save_instrument(Instrument(found.polarimeter), output)
        print(f"Written: {output}")
