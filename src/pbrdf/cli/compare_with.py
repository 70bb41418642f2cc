"""``pbrdf compare-with``: Mueller matrices of another program beside ours."""

from __future__ import annotations

import math
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
            metavar="FILE.npy",
            help="Their Mueller matrices, shape (..., 4, 4), in the order of ours (.npy, or .npz of one array).",
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
    from pbrdf.data.convention_comparison import compare_conventions, named_signs

    if (ours is None) == (flat is None):
        raise PbrdfError("give either OURS or --flat N,KAPPA: what the matrices are compared with")
    theirs = _array(file)
    where = _directions(ours, theta_i, theta_r, phi)
    matrices = _ours(ours, flat, where)
    if theirs.shape[-2:] == (4, 4) and where:
        _refuse_another_grid(theirs.shape[:-2], where)
    found = compare_conventions(theirs, matrices, convention)
    lines = _in_words(found, where)
    if "phi" in where:
        where["phi"] = where["phi"] + math.pi
        turned = compare_conventions(theirs, _ours(ours, flat, where), convention)
        if turned.fits_better_than(found):
            lines.append(
                "With φ half a turn further they fit better (0 is the side of the source there?): "
                f"{named_signs(turned.signs)}, largest difference {turned.by_signs[turned.signs]:.2g}"
            )
    for line in lines:
        print(visible(line))


def _array(path: Path) -> np.ndarray:
    """The array of a file of NumPy, or the only one of an archive."""
    import numpy as np

    kind = "a file of NumPy (.npy, .npz)"
    try:
        with path.open("rb") as file:
            start = file.read(6)
            # What numpy.load says of any other file is about pickles.
            if start != b"\x93NUMPY" and start[:2] != b"PK":
                raise PbrdfError(f"{path}: this is not {kind}")
            file.seek(0)
            loaded = np.load(file, allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                return loaded
            if len(loaded.files) != 1:
                raise PbrdfError(
                    f"{path}: one array is wanted, there are {', '.join(loaded.files) or 'none'}"
                )
            return np.asarray(loaded[loaded.files[0]])
    except PbrdfError:
        raise
    except FileNotFoundError:
        raise PbrdfError(f"{path}: there is no such file") from None
    except Exception as error:  # the library raises anything over a damaged file
        raise PbrdfError(f"{path}: cannot be read as {kind}: {error}") from None


def _directions(
    ours: str | None, theta_i: str | None, theta_r: str | None, phi: str | None
) -> dict[str, np.ndarray]:
    """Angles of incidence of a flat surface, of a model also those of view; none of matrices."""
    known = {"matrices": (), "a flat surface": ("--theta-i",), "a model": ("--theta-i", "--theta-r", "--phi")}
    what = "a flat surface" if ours is None else "matrices" if _is_array(ours) else "a model"
    for name, given in (("--theta-i", theta_i), ("--theta-r", theta_r), ("--phi", phi)):
        if given is not None and name not in known[what]:
            raise PbrdfError(f"{name}: {what} need{'' if what == 'matrices' else 's'} no such angle")
    flat = what == "a flat surface"
    found = directions_of(theta_i, "0" if flat else theta_r, "0" if flat else phi, False, None)
    return {name[2:].replace("-", "_"): found[name[2:].replace("-", "_")] for name in known[what]}


def _refuse_another_grid(shape: tuple[int, ...], where: dict[str, np.ndarray]) -> None:
    """Refuse another number of matrices than ours, and axes that are ours in another order."""
    sizes = {name: len(set(values)) for name, values in where.items()}
    order = ", ".join(f"{name.replace('theta', 'θ').replace('phi', 'φ')} ({n})" for name, n in sizes.items())
    given, wanted = ([size for size in x if size > 1] for x in (shape, sizes.values()))
    theirs, ours = math.prod(shape), len(where["theta_i"])
    if theirs != ours:
        raise PbrdfError(
            f"the file holds {theirs} matrices (axes {shape}), there are {ours} of ours: {order}"
        )
    if given != wanted and sorted(given) == sorted(wanted):
        raise PbrdfError(f"the axes of the file are {shape}; those of ours are {order}, in this order")


def _is_array(ours: str) -> bool:
    return ours.lower().endswith((".npy", ".npz"))


def _ours(ours: str | None, flat: str | None, where: dict[str, np.ndarray]) -> np.ndarray:
    """Our matrices, (N, 4, 4)."""
    if ours is None:
        from pbrdf.data.convention_comparison import flat_reflection

        n, _, kappa = str(flat).partition(",")
        return flat_reflection(where["theta_i"], number(n, "--flat"), number(kappa or "0", "--flat"))
    if not where:
        return _array(Path(ours))
    matrices: np.ndarray = open_single_model(ours).mueller(where["theta_i"], where["theta_r"], where["phi"])
    return matrices


def _in_words(found: ConventionComparison, where: dict[str, np.ndarray]) -> list[str]:
    from pbrdf.data.convention_comparison import named_signs

    number, row, column = found.place
    matrices = "1 matrix" if found.compared == 1 else f"{found.compared} matrices"
    lines = [
        f"{matrices}, read as {found.convention}'s: largest difference of M/M00 {found.difference:.2g} "
        f"(M{row}{column} of matrix {number + 1})",
        "M00 of theirs is 1 throughout: they are divided by M00"
        if found.divided
        else _scale(found.ratio, where),
    ]
    if found.left_out:
        more = "1 more is" if found.left_out == 1 else f"{found.left_out} more are"
        lines.append(f"{more} NaN or without light (M00 ≤ 0) and left out")
    if found.better is not None:
        lines.append(
            f"Another convention fits better: {named_signs(found.better)}, largest difference "
            f"{found.by_signs[found.better]:.2g}"
        )
    if found.alike:
        lines.append(f"These matrices do not tell this from: {'; '.join(map(named_signs, found.alike))}")
    if found.exchanged is not None:
        signs, difference = found.exchanged
        lines.append(
            f"With rows and columns exchanged they fit {'better' if found.better is None else 'as well'}: "
            f"{named_signs(signs)}, largest difference {difference:.2g}"
        )
    return lines


def _scale(ratio: np.ndarray, where: dict[str, np.ndarray]) -> str:
    """What M00 of theirs is of ours: a factor, with the cosine of an angle where that makes it one."""
    import numpy as np

    weights = {"": np.ones(len(ratio))}
    weights |= {f" cosθ_{x[-1]}": np.cos(where[x]) for x in ("theta_r", "theta_i") if x in where}
    for name, weight in weights.items():
        low, high = float(np.nanmin(ratio / weight)), float(np.nanmax(ratio / weight))
        if high - low <= 1e-5 * high:
            known = {"π": math.pi, "1/π": 1.0 / math.pi}
            close = [f" ({word})" for word, value in known.items() if math.isclose(low, value, rel_tol=1e-5)]
            return f"M00 of theirs is {low:.6g}{''.join(close)}{name} times ours"
    return f"M00 of theirs is {np.nanmin(ratio):.4g} to {np.nanmax(ratio):.4g} times ours"
