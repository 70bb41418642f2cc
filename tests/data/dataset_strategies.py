"""Hypothesis strategies for valid data sets of all forms."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pbrdf.data import make_dataset
from pbrdf.data.schema import QUANTITIES

FINITE = st.floats(allow_nan=False, allow_infinity=False)
VALUES = FINITE | st.just(np.nan)
POSITIVE = st.floats(min_value=0, exclude_min=True, allow_infinity=False) | st.just(np.nan)
NUMBERS = st.integers(-(2**60), 2**60) | FINITE
FORMS = (
    ("I",),
    ("I", "Q", "U", "V"),
    ("I", "dolp", "aolp"),
    ("dolp",),
    ("dolp", "aolp", "V_over_I"),
    ("mueller",),
    ("Q_over_I", "U_over_I", "V_over_I"),
    ("I", "Q_over_I"),
    ("mueller_over_m00",),
    ("I", "mueller_over_m00"),
)
RESERVED = {"quantity", "stokes_convention", "illumination", "simulated", "assumptions", "scale"}
RESERVED |= {"title", "source", "reference", "instrument", "azimuth", "stokes", "cosine_weighted", "angles"}


def zenith_angles():
    """Radians that come from degrees, and any other doubles."""
    degrees = st.floats(0, 90, exclude_max=True).map(np.deg2rad)
    round_degrees = st.integers(0, 89).map(float).map(np.deg2rad)
    return round_degrees | degrees | st.floats(0, np.pi / 2, exclude_max=True) | st.just(-0.0)


def azimuths():
    return st.floats(-360, 360).map(np.deg2rad) | st.floats(-2 * np.pi, 2 * np.pi)


def attributes():
    names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_.-]{0,8}", fullmatch=True)
    values = st.text() | NUMBERS | st.lists(NUMBERS) | st.lists(st.text())
    free = st.dictionaries(names.filter(lambda name: name.lower() not in RESERVED), values, max_size=3)
    texts = st.dictionaries(st.sampled_from(["title", "source", "reference", "instrument"]), st.text())
    return st.tuples(free, texts).map(lambda both: both[0] | both[1])


def covariances(draw, rows, channels):
    """Covariances of any structure: some variances unknown, some covariances, and none beyond the channels."""
    factors = draw(arrays(np.float64, (rows, 4, 4), elements=st.floats(-8, 8)))
    full = factors @ factors.transpose(0, 2, 1) + np.eye(4)
    full = 0.5 * (full + full.transpose(0, 2, 1))
    known = draw(arrays(bool, (rows, 4))) & np.isin(list("IQUV"), channels)
    full[~(known[:, :, None] & known[:, None, :])] = np.nan
    alone = draw(arrays(bool, rows))
    full[alone] = np.where(np.eye(4, dtype=bool), full[alone], np.nan)
    return full


@st.composite
def datasets(draw):
    rows = draw(st.integers(1, 4))

    def column(elements):
        return draw(arrays(np.float64, rows, elements=elements))

    form = draw(st.sampled_from(FORMS))
    channels, std = {}, {}
    for name in form:
        shape = (rows, 4, 4) if name.startswith("mueller") else rows
        elements = st.floats(-3.14, 3.14) | st.just(np.nan) if name == "aolp" else VALUES
        channels[name] = draw(arrays(np.float64, shape, elements=elements))
        if name == "mueller_over_m00":
            channels[name][:, 0, 0] = draw(st.sampled_from([1.0, np.nan]))
        if draw(st.booleans()):
            std[name] = draw(arrays(np.float64, shape, elements=POSITIVE))
    covariance = None
    if set(form) <= set("IQUV") and draw(st.booleans()):
        covariance = covariances(draw, rows, form)
        std = {}
        if draw(st.booleans()):  # stated besides, and not to the last bit the roots of the variances
            variance = np.einsum("gcc->cg", covariance)
            unknown = draw(arrays(np.float64, rows, elements=POSITIVE))
            stated = np.where(np.isnan(variance), unknown, np.sqrt(variance * (1 + 1e-9)))
            std = {name: stated["IQUV".index(name)] for name in form}
    numbers = st.integers(-(2**63), 2**63 - 1)
    text = st.text(min_size=1).filter(lambda t: t == t.strip() and t.isprintable())
    labels = st.lists(numbers, min_size=rows, max_size=rows) | st.lists(text, min_size=rows, max_size=rows)
    return make_dataset(
        column(zenith_angles()),
        column(zenith_angles()),
        column(azimuths()),
        quantity=draw(st.sampled_from(QUANTITIES[:-1] if "I" in form or "mueller" in form else QUANTITIES)),
        std=std,
        covariance=covariance,
        wavelength=column(POSITIVE) if draw(st.booleans()) else None,
        group=draw(st.none() | labels),
        illumination=draw(st.sampled_from([(1, 0, 0, 0), (1, 0.6, -0.3, 0.1)])),
        simulated=draw(st.booleans()),
        attrs=draw(attributes()),
        **channels,
    )


def same_bits(first, second) -> bool:
    """Whether two data sets agree in structure, attributes and every bit of every value."""
    if not first.identical(second) or first.attrs != second.attrs:
        return False
    if [type(first.attrs[name]) for name in first.attrs] != [
        type(second.attrs[name]) for name in first.attrs
    ]:
        return False
    # identical() takes 0.0 and −0.0 as equal.
    return all(
        first[name].dtype.kind == "U" or np.array_equal(np.signbit(first[name]), np.signbit(second[name]))
        for name in first.variables
        if first[name].dtype.kind == "f" and not np.isnan(first[name]).any()
    )
