"""What a data set is.

Every measurement and every simulation in the project is one :class:`xarray.Dataset` with the single
dimension ``geometry``: one row per pair of directions, wavelength and group. Angles are in **radians**.

Coordinates along ``geometry``
    ``theta_i``, ``theta_r``
        Zenith angles of source and viewer, [0, π/2).
    ``phi``
        Relative azimuth; φ = 0 is the forward (specular) half-plane, φ = π backscatter. Any finite value
        within one turn, |φ| ≤ 2π.
    ``wavelength`` (optional)
        In nm; NaN where it is not known.
    ``group`` (optional)
        What was measured together, for example one camera position: integers, or text without line
        breaks and surrounding white space. 0 everywhere when nothing was stated, or where it is left out.

Data variables: exactly one of five forms
    (a) Stokes parameters of the reflected light under the stated illumination: ``I`` and any of ``Q``,
        ``U``, ``V``;
    (b) ``dolp`` (degree of linear polarisation), with or without ``aolp`` (its angle, radians), ``V_over_I`` and
        ``I``;
    (c) ``mueller`` with the dimensions (``geometry``, ``stokes_out``, ``stokes_in``), whose coordinates
        are I, Q, U, V;
    (d) normalised Stokes parameters: any of ``Q_over_I``, ``U_over_I``, ``V_over_I``, with or without ``I``;
    (e) ``mueller_over_m00``, the Mueller matrix divided by its element m00, of the dimensions of ``mueller``, with
        or without ``I`` (the intensity under the stated illumination). Its own element m00 is 1 or NaN and says
        nothing.

    Ratios (dolp, aolp and what has ``over`` in its name) are free of any factor common to all channels: no
    conversion of the quantity, no cosine and no gain touches them.

    Each may have a standard uncertainty of the same shape in the variable ``<name>_std``, > 0. NaN means
    *not measured here*, and, in an uncertainty, *not known*.

    Beside form (a) there may be ``covariance``, that of the errors of I, Q, U, V at each geometry, with the
    dimensions (``geometry``, ``stokes_row``, ``stokes_column``), whose coordinates are I, Q, U, V, in the
    square of the data's unit. It is symmetric and positive semidefinite; its diagonal is the square of the
    standard uncertainties, to a relative 1e-6. NaN off the diagonal: not known, counts as independent. NaN
    on the diagonal (then in the whole row and column): ``<name>_std``, if there is one, stands by itself.
    A component without a data variable has none.

Attributes
    ``quantity``
        ``"brdf"`` (1/sr), ``"reflectance_factor"`` (π · BRDF, 1), ``"radiance"`` (arbitrary units,
        proportional to BRDF · cos θ_i) or ``"dn"`` (the same, digital numbers of a camera). It describes
        I, Q, U, V and the Mueller matrix. ``"normalised"``: there are only ratios (where a file that holds only
        ratios states another quantity, that is kept and describes nothing).
    ``stokes_convention``
        Always ``"p-s"``: Q = I_p − I_s, (p, s, k) right-handed. Readers convert.
    ``illumination``
        Stokes vector of the source, four numbers; ``[1, 0, 0, 0]`` is natural light. It applies to forms
        (a), (b) and (d), and to the I of (e).
    ``simulated``
        1 if a model produced the numbers, else 0.
    ``title``, ``source``, ``reference``, ``instrument`` (optional)
        Free text.
    ``scale`` (optional)
        ``"arbitrary"`` where an unknown constant factor is left in the values, ``"absolute"`` where none is (which is
        taken for granted of a BRDF or a reflectance factor, and not of radiances and digital numbers).
    ``assumptions`` (optional)
        Sentences: what a reader assumed because the file did not say.
    ``readings`` (optional)
        What each reading behind an analyser was taken for, where the Stokes parameters come from such.

Further attributes are kept if they are text, finite numbers or lists of these.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr

__all__ = [
    "ANGLES",
    "ATTRIBUTE_NAME",
    "COORDINATES",
    "COVARIANCE",
    "DIMENSION",
    "FILE_KEYS",
    "FORMS",
    "NATURAL_LIGHT",
    "NORMALISED",
    "QUANTITIES",
    "RATIOS",
    "STOKES_AXES",
    "TEXT_ATTRIBUTES",
    "UNITS",
    "VARIABLES",
    "is_ratio",
    "only_ratios",
    "spells_integer",
    "std_name",
    "variable_dims",
    "variable_units",
    "written",
]

DIMENSION = "geometry"
NATURAL_LIGHT = (1.0, 0.0, 0.0, 0.0)

#: The quantity of data that hold ratios only.
NORMALISED = "normalised"
QUANTITIES = ("brdf", "reflectance_factor", "radiance", "dn", NORMALISED)
COORDINATES = ("theta_i", "theta_r", "phi", "wavelength", "group")
#: Variables that no common factor of the channels changes: they say nothing about the scale of the data.
RATIOS = ("dolp", "aolp", "Q_over_I", "U_over_I", "V_over_I", "mueller_over_m00")
VARIABLES = ("I", "Q", "U", "V", "dolp", "aolp", "mueller", *RATIOS[2:])

#: The variable that holds the covariance of the Stokes components.
COVARIANCE = "covariance"
#: Coordinates that count Stokes components: of Mueller matrices, then of covariances.
STOKES_AXES = ("stokes_out", "stokes_in", "stokes_row", "stokes_column")

#: The forms of a data set: variables of which any makes the form, and those that may stand beside it.
FORMS = (
    (("I",), ("Q", "U", "V")),
    (("dolp",), ("I", "aolp", "V_over_I")),
    (("mueller",), ()),
    (("Q_over_I", "U_over_I", "V_over_I"), ("I",)),
    (("mueller_over_m00",), ("I",)),
)

#: Variables in radians; files hold them in degrees.
ANGLES = ("theta_i", "theta_r", "phi", "aolp", "aolp_std")

TEXT_ATTRIBUTES = ("title", "source", "reference", "instrument")

#: Header keys by which a CSV file states its own conventions; no attribute may have these names.
FILE_KEYS = ("azimuth", "stokes", "cosine_weighted", "angles", "coverage")

#: What an attribute may be called, so that every file format can hold it.
ATTRIBUTE_NAME = r"[A-Za-z_][A-Za-z0-9_.-]*"

UNITS = {"brdf": "1/sr", "reflectance_factor": "1", "radiance": "arbitrary", "dn": "1", NORMALISED: "1"}


def std_name(variable: str) -> str:
    """Name of the variable that holds the standard uncertainty of `variable`."""
    return f"{variable}_std"


def is_ratio(name: str) -> bool:
    """Whether a variable, or a channel of a fit such as ``m01_over_m00``, is free of the scale of the data."""
    return name in RATIOS or "_over_" in name


def written(name: str) -> str:
    """A variable or channel as people write it: ``Q/I`` for ``Q_over_I``."""
    return name.replace("_over_", "/")


def only_ratios(names: Iterable[object]) -> bool:
    """Whether none of the data variables of these names has the unit of the quantity."""
    return not any(name in VARIABLES and not is_ratio(str(name)) for name in names)


def variable_dims(variable: str) -> tuple[str, ...]:
    """Dimensions of a data variable, of its uncertainty or of the covariance."""
    if variable.removesuffix("_std") in ("mueller", "mueller_over_m00"):
        return (DIMENSION, *STOKES_AXES[:2])
    if variable == COVARIANCE:
        return (DIMENSION, *STOKES_AXES[2:])
    return (DIMENSION,)


def variable_units(variable: str, quantity: str) -> str:
    """Content of the attribute ``units``; empty if there is no unit to name."""
    base = variable.removesuffix("_std")
    if variable in ANGLES:
        return "rad"
    if base == "wavelength":
        return "nm"
    if is_ratio(base):
        return "1"
    if base == "group":
        return ""
    unit = UNITS.get(quantity, "")
    return "1/sr2" if variable == COVARIANCE and unit == "1/sr" else unit


def with_group(ds: xr.Dataset) -> xr.Dataset:
    """The data set with a coordinate ``group``: 0 everywhere where it has none."""
    if "group" in ds.coords or DIMENSION not in ds.sizes:
        return ds
    return ds.assign_coords(group=(DIMENSION, np.zeros(ds.sizes[DIMENSION], dtype=np.int64)))


def spells_integer(label: str) -> bool:
    """Whether a group label reads back from text as an integer."""
    try:
        return str(int(label)) == label and np.iinfo(np.int64).min <= int(label) <= np.iinfo(np.int64).max
    except ValueError:
        return False
