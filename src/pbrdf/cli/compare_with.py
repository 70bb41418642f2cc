"""``pbrdf compare-with``: Mueller matrices of another program beside ours."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pbrdf.cli.directions import GRID, directions_of
from pbrdf.cli.options import angles_option
from pbrdf.cli.sources import open_single_model
from pbrdf.cli.values import number
from pbrdf.errors import PbrdfError, visible

if TYPE_CHECKING:
    import numpy as np

    from pbrdf.data.convention_comparison import ConventionComparison

__all__ = ["compare_with"]

_PROGRAMS = "eradiate|katsu|mitsuba|polanalyser|pyelli|pypolar|scatmech"


def compare_with(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.npy", help="Their Mueller matrices, shape (..., 4, 4), in the order of ours."
        ),
    ],
    ours: Annotated[
        str | None,
        typer.Argument(
            metavar="[OURS]",
            help="A model's JSON file, the folder of a fit, a bundled paint, or matrices in our convention (.npy).",
            show_default=False,
        ),
    ] = None,
    *,
    convention: Annotated[
        str,
        typer.Option(help="Program whose convention the file is in.", metavar=_PROGRAMS, show_default=False),
    ],
    flat: Annotated[
        str | None,
        typer.Option(
            help="In the place of OURS: reflection off a bare flat surface of the index N − i KAPPA, at --theta-i.",
            metavar="N[,KAPPA]",
        ),
    ] = None,
    theta_i: Annotated[str | None, angles_option("Angles of incidence, slowest.", GRID["theta_i"])] = None,
    theta_r: Annotated[
        str | None, angles_option("Viewing angles of a model.", show_default=GRID["theta_r"])
    ] = None,
    phi: Annotated[
        str | None,
        angles_option("Azimuths of a model, 0 in the forward half-plane, fastest.", show_default=GRID["phi"]),
    ] = None,
) -> None:
    """Convert matrices of another program and compare them with ours.

    It tells the largest difference of M/M00, the scale of M00, and whether another program's convention fits better.

    A flat surface: `pbrdf compare-with gold.npy --flat 0.47,2.83 --theta-i 30,70 --convention pypolar`
    """
    from pbrdf.data.convention_comparison import compare_conventions

    if (ours is None) == (flat is None):
        raise PbrdfError("give either OURS or --flat N,KAPPA: what the matrices are compared with")
    found = compare_conventions(_array(file), _ours(ours, flat, theta_i, theta_r, phi), convention)
    for line in _in_words(found):
        print(visible(line))


def _array(path: Path) -> np.ndarray:
    import numpy as np

    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (OSError, ValueError, EOFError) as error:
        raise PbrdfError(f"{path}: cannot be read as a file of NumPy (.npy): {error}") from None


def _ours(
    ours: str | None, flat: str | None, theta_i: str | None, theta_r: str | None, phi: str | None
) -> np.ndarray:
    """Our matrices, (N, 4, 4)."""
    matrices = ours is not None and ours.endswith(".npy")
    for name, given in (("--theta-i", theta_i), ("--theta-r", theta_r), ("--phi", phi)):
        if given is not None and (matrices or (flat is not None and name != "--theta-i")):
            raise PbrdfError(f"{name}: {'matrices' if matrices else 'a flat surface'} need no such angle")
    if ours is None:
        from pbrdf.data.convention_comparison import flat_reflection

        n, _, kappa = str(flat).partition(",")
        where = directions_of(theta_i, "0", "0", False, None)
        return flat_reflection(where["theta_i"], number(n, "--flat"), number(kappa or "0", "--flat"))
    if matrices:
        return _array(Path(ours))
    where = directions_of(theta_i, theta_r, phi, False, None)
    matrices_of_model: np.ndarray = open_single_model(ours).mueller(
        *(where[x] for x in ("theta_i", "theta_r", "phi"))
    )
    return matrices_of_model


def _in_words(found: ConventionComparison) -> list[str]:
    from pbrdf.data.convention_comparison import named_signs

    number, row, column = found.place
    low, high = found.scale
    lines = [
        f"{found.compared} matrices, read as {found.convention}'s: largest difference of M/M00 "
        f"{found.difference:.2g} (M{row}{column} of matrix {number + 1})",
        f"M00 of theirs is {low:.6g} times ours"
        if high - low <= 1e-5 * high
        else f"M00 of theirs is {low:.4g} to {high:.4g} times ours",
    ]
    if found.left_out:
        lines.append(f"{found.left_out} more are NaN or without light (M00 ≤ 0) and left out")
    if found.better is not None:
        lines.append(
            f"Another convention fits better: {named_signs(found.better)}, largest difference "
            f"{found.by_signs[found.better]:.2g}"
        )
    if found.alike:
        lines.append(f"These matrices do not tell this from: {'; '.join(map(named_signs, found.alike))}")
    return lines
