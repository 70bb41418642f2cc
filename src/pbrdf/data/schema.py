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
    ``group``
        What was measured together, for example one camera position: integers, or text without line
        breaks and surrounding white space. 0 everywhere when nothing was stated.

Data variables: exactly one of three forms
    (a) Stokes parameters of the reflected light under the stated illumination: ``I`` and any of ``Q``,
        ``U``, ``V``;
    (b) ``I`` with ``dolp`` (degree of linear polarisation) and, optionally, ``aolp`` (its angle, radians);
    (c) ``mueller`` with the dimensions (``geometry``, ``stokes_out``, ``stokes_in``), whose coordinates
        are I, Q, U, V.

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
        I, Q, U, V and the Mueller matrix.
    ``stokes_convention``
        Always ``"p-s"``: Q = I_p − I_s, (p, s, k) right-handed. Readers convert.
    ``illumination``
        Stokes vector of the source, four numbers; ``[1, 0, 0, 0]`` is natural light. It applies to forms
        (a) and (b).
    ``simulated``
        1 if a model produced the numbers, else 0.
    ``title``, ``source``, ``reference``, ``instrument`` (optional)
        Free text.
    ``scale`` (optional)
        ``"arbitrary"`` where an unknown constant factor is left in the values, ``"absolute"`` where none is (which is
        taken for granted of a BRDF or a reflectance factor, and not of radiances and digital numbers).
    ``assumptions`` (optional)
        Sentences: what a reader assumed because the file did not say.

Further attributes are kept if they are text, finite numbers or lists of these.
"""

from __future__ import annotations

import numpy as np

__all__ = [
    "ANGLES",
    "ATTRIBUTE_NAME",
    "COORDINATES",
    "COVARIANCE",
    "DIMENSION",
    "FILE_KEYS",
    "FORMS",
    "NATURAL_LIGHT",
    "QUANTITIES",
    "STOKES_AXES",
    "TEXT_ATTRIBUTES",
    "UNITS",
    "VARIABLES",
    "spells_integer",
    "std_name",
    "variable_dims",
    "variable_units",
]

DIMENSION = "geometry"
NATURAL_LIGHT = (1.0, 0.0, 0.0, 0.0)

QUANTITIES = ("brdf", "reflectance_factor", "radiance", "dn")
COORDINATES = ("theta_i", "theta_r", "phi", "wavelength", "group")
VARIABLES = ("I", "Q", "U", "V", "dolp", "aolp", "mueller")

#: The variable that holds the covariance of the Stokes components.
COVARIANCE = "covariance"
#: Coordinates that count Stokes components: of Mueller matrices, then of covariances.
STOKES_AXES = ("stokes_out", "stokes_in", "stokes_row", "stokes_column")

#: The three forms of a data set: the variable that makes the form, and those that may stand beside it.
FORMS = (("I", ("Q", "U", "V")), ("dolp", ("I", "aolp")), ("mueller", ()))

#: Variables in radians; files hold them in degrees.
ANGLES = ("theta_i", "theta_r", "phi", "aolp", "aolp_std")

TEXT_ATTRIBUTES = ("title", "source", "reference", "instrument")

#: Header keys by which a CSV file states its own conventions; no attribute may have these names.
FILE_KEYS = ("azimuth", "stokes", "cosine_weighted", "angles", "coverage")

#: What an attribute may be called, so that every file format can hold it.
ATTRIBUTE_NAME = r"[A-Za-z_][A-Za-z0-9_.-]*"

UNITS = {"brdf": "1/sr", "reflectance_factor": "1", "radiance": "arbitrary", "dn": "1"}


def std_name(variable: str) -> str:
    """Name of the variable that holds the standard uncertainty of `variable`."""
    return f"{variable}_std"


def variable_dims(variable: str) -> tuple[str, ...]:
    """Dimensions of a data variable, of its uncertainty or of the covariance."""
    if variable in ("mueller", "mueller_std"):
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
    if base == "dolp":
        return "1"
    if base == "group":
        return ""
    unit = UNITS.get(quantity, "")
    return "1/sr2" if variable == COVARIANCE and unit == "1/sr" else unit


def spells_integer(label: str) -> bool:
    """Whether a group label reads back from text as an integer."""
    try:
        return str(int(label)) == label and np.iinfo(np.int64).min <= int(label) <= np.iinfo(np.int64).max
    except ValueError:
        return False
