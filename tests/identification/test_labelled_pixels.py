"""Labels of pixels from files, and what the pixels were taken for."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.identification.labelled_pixels import image_of, judge_pixels, read_material_labels

NAMES = ["white", "dark grey", "red"]


def mapped(material):
    """A map with these numbers of materials, all told with 80 %."""
    material = np.asarray(material, dtype=np.int16)
    inside = material[None] == np.arange(3)[:, None, None]
    by_name = ("material_name", "y", "x")
    return xr.Dataset(
        {
            "material": (("y", "x"), material, {"flag_values": [-2, -1, 0, 1, 2],
             "flag_meanings": "not_measured none_of_these white dark_grey red"}),
            "probability": (by_name, np.where(inside, 0.8, 0.1).astype(np.float32)),
            "in_set": (by_name, inside),
        },
        coords={"material_name": NAMES},
        attrs={"confidence": 0.95},
    )  # fmt: skip


FOUND = mapped([[0, 0, 1, 2], [1, -1, -2, 2]])


def labels(values, **attrs):
    return xr.DataArray(np.asarray(values), dims=("y", "x"), attrs=attrs)


def test_numbers_without_names_count_the_librarys_materials():
    table = judge_pixels(FOUND, labels([[1, 1, 2, 2], [0, 1, 1, 7]]))
    assert table.truth == ("white", "dark grey", "label 7")
    assert table.taken_for == (*NAMES, "none of these")
    # one pixel has no label, one was not measured
    assert table.counts.tolist() == [[2, 0, 0, 1], [0, 1, 1, 0], [0, 0, 1, 0]]
    assert table.coverage == pytest.approx([2 / 3, 1 / 2, 0.0])
    assert table.reliability.count.sum() == 5


def test_names():
    table = judge_pixels(FOUND, labels([["white", "", "dark grey", "dark_grey"], ["", "", "", "blue"]]))
    assert table.truth == ("white", "dark grey", "blue")
    assert table.counts.sum() == 4


def test_stated_meanings_and_another_identification():
    """Numbers from 0 with names, as a map of materials has them; it agrees with itself but where it knows nothing."""
    table = judge_pixels(FOUND, FOUND["material"].T)
    assert table.accuracy == 1.0
    assert table.truth == (*NAMES, "none_of_these")
    assert table.counts.sum() == 7
    own = labels([[4, 4, 4, 4], [9, 9, 9, 9]], flag_values=[4, 9], flag_meanings="red blue")
    assert judge_pixels(FOUND, own).truth == ("red", "blue")


def test_what_no_label_is():
    with pytest.raises(DataError, match="no pixel that was measured has a label"):
        judge_pixels(FOUND, labels(np.zeros((2, 4), int)))
    with pytest.raises(DataError, match="names or whole numbers"):
        judge_pixels(FOUND, labels(np.zeros((2, 4))))


def test_files(tmp_path):
    from PIL import Image

    like = FOUND["material"]
    numbers = np.array([[1, 1, 2, 2], [0, 1, 1, 3]], dtype=np.uint8)
    names = np.array(["", *NAMES])[numbers]
    np.save(tmp_path / "numbers.npy", numbers)
    np.save(tmp_path / "names.npy", names)
    Image.fromarray(numbers).save(tmp_path / "numbers.png")
    xr.Dataset({"labels": (("x", "y"), names.T)}).to_netcdf(tmp_path / "names.nc", engine="h5netcdf")
    xr.Dataset({"material": (("y", "x"), numbers)}).to_netcdf(tmp_path / "numbers.nc", engine="h5netcdf")
    (tmp_path / "regions.toml").write_text(
        "".join(f"['{n}']\nlabels = 'numbers.png'\nvalue = {k}\n" for k, n in enumerate(NAMES, start=1)),
        encoding="utf-8",
    )
    expected = judge_pixels(FOUND, labels(names)).counts
    for name in ("numbers.npy", "names.npy", "numbers.png", "names.nc", "numbers.nc", "regions.toml"):
        found = judge_pixels(FOUND, read_material_labels(tmp_path / name, like))
        assert found.counts.tolist() == expected.tolist(), name


def test_files_of_another_image(tmp_path):
    like = FOUND["material"]
    np.save(tmp_path / "wide.npy", np.ones((2, 5), int))
    with pytest.raises(
        DataError, match=r"wide\.npy: its shape is \(2, 5\), the image is over y \(2\), x \(4\)"
    ):
        read_material_labels(tmp_path / "wide.npy", like)
    xr.Dataset({"label": (("y", "z"), np.ones((2, 4), int))}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=r"label is over y \(2\), z \(4\), the image over y \(2\), x \(4\)"):
        read_material_labels(tmp_path / "a.nc", like)
    xr.Dataset({"depth": (("y", "x"), np.ones((2, 4)))}).to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    with pytest.raises(DataError, match="labels are a variable material or labels or label; it has depth"):
        read_material_labels(tmp_path / "b.nc", like)
    with pytest.raises(DataError, match="no such file"):
        read_material_labels(tmp_path / "none.npy", like)
    (tmp_path / "broken.npy").write_bytes(b"nothing")
    with pytest.raises(DataError, match="not an array of NumPy"):
        read_material_labels(tmp_path / "broken.npy", like)
    with pytest.raises(DataError, match="a picture has two dimensions, the image is over x"):
        read_material_labels(tmp_path / "regions.toml", like[0])


def test_the_image_of_a_map():
    data = xr.Dataset({"Q": (("y", "geometry", "x"), np.zeros((2, 3, 4)))})
    assert dict(image_of(data).sizes) == {"y": 2, "x": 4}
    assert dict(image_of(xr.Dataset({"estimate": (("parameter", "z"), np.zeros((2, 5)))})).sizes) == {"z": 5}


def test_labels_of_other_pixels_are_refused_with_both(tmp_path):
    image = FOUND.assign_coords(y=[0, 1], x=range(4))
    turned = labels([[1, 1, 2, 2], [0, 1, 1, 7]]).assign_coords(y=[1, 0])
    with pytest.raises(
        DataError, match="y is 1, 0 in the labels, and 0, 1 in the map: these are not the same"
    ):
        judge_pixels(image, turned)
    turned.rename("labels").to_netcdf(tmp_path / "labels.nc", engine="h5netcdf")
    with pytest.raises(DataError, match=r"y is 1, 0 in .*labels\.nc, and 0, 1 in the image"):
        read_material_labels(tmp_path / "labels.nc", image["material"])
    assert judge_pixels(FOUND, turned).counts.sum() > 0
