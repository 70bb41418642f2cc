"""What is put together goes by its labels."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pbrdf.data.alignment import few, in_stokes_order, require_same_labels
from pbrdf.errors import DataError


def matrices(order, kind=str):
    """Element (i, j) is 10 i + j, by the components that it is of."""
    at = ["IQUV".index(name) for name in order]
    values = np.add.outer(10.0 * np.arange(4), np.arange(4.0))[np.ix_(at, at)]
    labels = np.array(list(order), dtype="S1" if kind is bytes else kind)
    return xr.Dataset(
        {"mueller": (("stokes_out", "stokes_in"), values), "other": ("y", [1.0, 2.0])},
        {"stokes_out": labels, "stokes_in": labels},
    )


@pytest.mark.parametrize("kind", [str, bytes, object])
@pytest.mark.parametrize("order", ["IQUV", "IUQV", "VUQI"])
def test_components_are_found_by_their_labels(order, kind):
    found = in_stokes_order(matrices(order, kind))
    np.testing.assert_array_equal(found["mueller"], matrices("IQUV")["mueller"])
    assert found["stokes_out"].values.astype(str).tolist() == list("IQUV")


def test_data_without_labels_stay_as_they_are_and_other_labels_are_refused():
    plain = matrices("VUQI").drop_vars(["stokes_out", "stokes_in"])
    assert in_stokes_order(plain) is plain
    for labels, words in ((["s0", "s1", "s2", "s3"], "s0, s1, s2, s3"), (list("IQUU"), "I, Q, U, U")):
        with pytest.raises(DataError, match=f"the coordinate stokes_in must be I, Q, U, V, not {words}"):
            in_stokes_order(matrices("IQUV").assign_coords(stokes_in=labels))


def places(y, units=None):
    return xr.Dataset(coords={"y": ("y", y, {} if units is None else {"units": units})})


@pytest.mark.parametrize(
    ("here", "there", "words"),
    [
        (places([3, 2, 1, 0]), places([0, 1, 2, 3]), "y is 3, 2, 1, 0 in ours, and 0, 1, 2, 3 in theirs"),
        (places(np.arange(10, 20)), places(np.arange(10)), r"y is 10, 11, … 19 in ours, and 0, 1, … 9 in"),
        (places([0.0, 1.0], "mm"), places([0.0, 1.0]), "y is 0, 1 mm in ours, and 0, 1 1 in theirs"),
        (places(["b", "a"]), places(["a", "b"]), "y is b, a in ours, and a, b in theirs"),
        (places([0.0, 1.0]), places([0.0, 1.0, 2.0]), "y is 0, 1 in ours"),
    ],
)
def test_other_places_are_refused_with_both(here, there, words):
    with pytest.raises(DataError, match=f"{words}.*not the same places.* leave the coordinate y out"):
        require_same_labels(here, "ours", there, "theirs", ["y"])


def test_the_same_places_are_the_same_in_any_type():
    for here, there in (
        (places(np.linspace(0.0, 1.0, 7)), places(np.linspace(0.0, 1.0, 7, dtype=np.float32))),
        (places([0, 1]), places([0.0, 1.0], "1")),
        (places(["a"]), places(np.array(["a"], dtype=object))),
        (places([3, 2]), xr.Dataset({"I": ("y", [1.0, 2.0])})),
    ):
        require_same_labels(here, "ours", there, "theirs", ["y", "x"])


def test_few_values_in_words():
    assert few([1.0, 2.5]) == "1, 2.5"
    assert few("brdf") == "brdf"
    assert few(np.arange(100)) == "0, 1, … 99"
