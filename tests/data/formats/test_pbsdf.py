from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pbrdf.data import check, read
from pbrdf.data.formats.pbsdf import SIMULATED, PolarizedTable, mueller_to_pbsdf, read_table, write_table
from pbrdf.data.formats.tensor_file import read_tensors, write_tensors
from pbrdf.errors import DataError
from pbrdf.models import DoubleGauss
from pbrdf.optics.half_difference import directions

GLASS = DoubleGauss(0.2, 1.5, 0.0, 1.0, 0.0, 0.0)
METAL = DoubleGauss(0.2, 1.5 - 2.0j, 0.3, 1.4, 0.5, 0.8)
QUARTER = np.pi / 2


def tabulated(*models: DoubleGauss) -> PolarizedTable:
    """A coarse table of models, NaN where a direction is below the horizon, as measured tables have it."""
    theta_h = np.float32([1e-6, 0.1, 0.3, 0.6, 1.0])
    theta_d = np.float32([1e-6, 0.4, 0.8, 1.2])
    phi_d = np.linspace(-np.pi, np.pi, 9).astype(np.float32)
    p, d, h = (a.astype(float) for a in np.meshgrid(phi_d, theta_d, theta_h, indexing="ij"))
    i, r, phi = directions(h, d, p)
    above = (i < QUARTER) & (r < QUARTER)
    matrices = np.full((*above.shape, len(models), 4, 4), np.nan, dtype=np.float32)
    for which, model in enumerate(models):
        f = model.mueller(i[above], r[above], phi[above])
        matrices[above, which] = mueller_to_pbsdf(f, h[above], d[above], p[above])
    wavelength = np.array([450, 500, 550, 600, 650][: len(models)], dtype=np.uint16)
    return PolarizedTable(theta_h, theta_d, phi_d, wavelength, matrices)


def store(table: PolarizedTable, path) -> None:
    """A file as others write it, whatever the table holds."""
    fields = {name: getattr(table, name)[np.newaxis] for name in ("theta_h", "theta_d", "phi_d")}
    fields |= {"wvls": table.wavelength, "M": table.matrices}
    write_tensors(fields, path)


def filled(table: PolarizedTable) -> PolarizedTable:
    """With a depolariser of 1/sr in place of what is missing."""
    missing = np.isnan(table.matrices[..., :1, :1])
    return replace(
        table,
        matrices=np.where(missing, np.diag(np.float32([1, 0, 0, 0])), table.matrices).astype(np.float32),
    )


@pytest.fixture
def file(tmp_path):
    store(tabulated(METAL, GLASS), tmp_path / "two.pbsdf")
    return tmp_path / "two.pbsdf"


def test_the_data_set_is_the_model_at_the_nodes(file):
    ds = read(file, every=1)
    assert ds.attrs["quantity"] == "brdf"
    assert check(ds) == []
    for wavelength, model in ((450, METAL), (500, GLASS)):
        rows = ds.isel(geometry=ds["wavelength"].values == wavelength)
        exact = model.mueller(rows["theta_i"].values, rows["theta_r"].values, rows["phi"].values)
        off = np.abs(rows["mueller"].values - exact).max((1, 2)) / exact[:, 0, 0]
        assert off.max() < 8 * np.finfo(np.float32).eps


def test_cells_below_the_horizon_and_without_a_value_are_left_out(file):
    ds = read(file, every=1)
    assert 0 < ds.sizes["geometry"] < 2 * 5 * 4 * 9
    assert max(ds["theta_i"].max(), ds["theta_r"].max()) < QUARTER
    assert np.isfinite(ds["mueller"]).all()
    table = tabulated(METAL)
    table.matrices[4, 1, 2, 0, 3, 3] = np.nan
    store(table, file)
    assert read(file, every=1).sizes["geometry"] == ds.sizes["geometry"] / 2 - 1


def test_a_finite_value_below_the_horizon_is_no_measurement(file):
    """Tables are filled there, so that interpolation at the edge works."""
    table = tabulated(METAL)
    rows = read(file, every=1, wavelength=450).sizes["geometry"]
    write_table(filled(table), file)
    assert read(file, every=1).sizes["geometry"] == rows


def test_a_wavelength_can_be_chosen(file):
    ds = read(file, wavelength=500)
    assert_array_equal(np.unique(ds["wavelength"]), [500.0])
    with pytest.raises(DataError, match="700 nm was not measured; there are 450, 500 nm"):
        read(file, wavelength=700)


def test_every_takes_that_part_of_the_nodes(file):
    ds = read(file, every=2, wavelength=450)
    table = tabulated(METAL)
    p, d, h = np.meshgrid(table.phi_d[::2], table.theta_d[::2], table.theta_h[::2], indexing="ij")
    i, r, _ = directions(h, d, p)
    above = (np.cos(i) > 1e-6) & (np.cos(r) > 1e-6)
    assert_allclose(ds["theta_i"], i[above])
    assert "one node in 2 of each angle" in ds.attrs["source"]
    with pytest.raises(DataError, match="every=0: give a whole number from 1"):
        read(file, every=0)


def test_a_large_table_is_thinned_unless_it_says_otherwise(tmp_path):
    axes = [np.linspace(0.01, 1.2, 40), np.linspace(0.01, 1.2, 40), np.linspace(-np.pi, np.pi, 37)]
    h, d, p = (a.astype(np.float32) for a in axes)
    table = PolarizedTable(
        h,
        d,
        p,
        np.array([550], np.uint16),
        np.ones((37, 40, 40, 1, 4, 4), np.float32) * np.eye(4, dtype=np.float32),
    )
    write_table(table, tmp_path / "large.pbsdf")
    thinned, whole = read(tmp_path / "large.pbsdf"), read(tmp_path / "large.pbsdf", every=1)
    assert thinned.sizes["geometry"] < 20_000 < whole.sizes["geometry"]
    assert "one node in 2" in thinned.attrs["source"]


def test_light_reflected_by_glass_is_polarised_along_s(file):
    """In the file x is normal to the plane of both rays and Q > 0 along it: m01 = m10 > 0 for a specular surface."""
    m = tabulated(GLASS).matrices[..., 0, :, :]
    seen = np.isfinite(m[..., 0, 0]) & (m[..., 0, 0] > 0)
    seen[:, 0] = False  # normal incidence on the facet does not polarise
    assert (m[seen, 0, 1] > 0).all()
    assert_allclose(m[seen, 0, 1], m[seen, 1, 0], rtol=1e-5)


def test_circular_light_changes_sides_and_q_and_u_change_sign():
    """Ours (p, s), V > 0 left, to the file's (s, ·), V > 0 right: diag(1, −1, −1, −1) on both sides.

    At θ_h → 0 the frames of the surface are those of the scattering plane.
    """
    ours = np.arange(1.0, 17.0).reshape(4, 4)
    D = np.diag([1.0, -1.0, -1.0, -1.0])
    assert_allclose(mueller_to_pbsdf(ours, 1e-9, 0.5, 0.0), D @ ours @ D, atol=1e-6)


def test_the_table_interpolates_linearly_and_holds_the_last_node_outside(tmp_path):
    """Depolarising matrices that grow with all three angles: halfway between the nodes is their mean."""
    h, d, p = (np.float32([0.2, 0.4]), np.float32([0.3, 0.7]), np.float32([0.5, 1.5]))
    f = h[np.newaxis, np.newaxis] + 10 * d[:, np.newaxis] + 100 * p[:, np.newaxis, np.newaxis]
    matrices = np.zeros((2, 2, 2, 1, 4, 4), dtype=np.float32)
    matrices[..., 0, 0, 0] = f
    write_table(PolarizedTable(h, d, p, np.array([550], np.uint16), matrices), tmp_path / "t.pbsdf")
    table = read_table(tmp_path / "t.pbsdf")
    angles = np.array([(0.25, 0.4, 0.6), (0.3, 0.5, 1.0), (0.1, 0.2, 0.0), (0.5, 0.8, 2.0)]).T
    inside = [np.clip(a, n[0], n[-1]) for a, n in zip(angles, (h, d, p), strict=True)]
    expected = inside[0] + 10 * inside[1] + 100 * inside[2]
    assert_allclose(table.mueller(*directions(*angles))[:, 0, 0], expected, rtol=1e-6)


def test_a_simulated_table_says_so(tmp_path):
    table = replace(filled(tabulated(GLASS)), description=f"{SIMULATED} 1: glass")
    write_table(table, tmp_path / "glass.pbsdf")
    ds = read(tmp_path / "glass.pbsdf")
    assert ds.attrs["simulated"] == 1
    assert ds.attrs["source"] == f"glass.pbsdf: {SIMULATED} 1: glass"
    write_table(filled(tabulated(GLASS)), tmp_path / "glass.pbsdf")
    assert read(tmp_path / "glass.pbsdf").attrs["simulated"] == 0


def test_mitsubas_plugin_holds_five_wavelengths(tmp_path):
    table = filled(tabulated(*[GLASS] * 5))
    write_table(table, tmp_path / "five.pbsdf")
    six = np.concatenate([table.matrices, table.matrices[:, :, :, :1]], axis=3)
    with pytest.raises(DataError, match=r"6 wavelengths are too many: .* at most 5"):
        write_table(
            replace(table, wavelength=np.arange(450, 456, dtype=np.uint16), matrices=six),
            tmp_path / "six.pbsdf",
        )
    assert [path.name for path in tmp_path.iterdir()] == ["five.pbsdf"]


def test_five_wavelengths_can_be_read_where_the_file_has_fewer(file):
    """The plugin reads five numbers of 2 bytes at the field wvls, whatever its size: they must be inside the file."""
    raw = file.read_bytes()
    at = read_tensors(file)["wvls"].offset
    assert at + 10 < len(raw)


def test_descending_wavelengths_of_others_keep_their_names(file):
    """Each matrix is read under the wavelength that stands with it, though the plugin takes one for another."""
    table = tabulated(METAL, GLASS)
    store(replace(table, wavelength=table.wavelength[::-1]), file)
    for wavelength, model in ((500, METAL), (450, GLASS)):
        ds = read(file, every=1, wavelength=wavelength)
        exact = model.mueller(ds["theta_i"].values, ds["theta_r"].values, ds["phi"].values)
        assert_allclose(ds["mueller"][:, 0, 0], exact[:, 0, 0], rtol=1e-6)
    both = read(file, every=1)
    assert set(both["wavelength"].values) == {450.0, 500.0}


def test_an_intensity_below_0_of_others_is_noise_and_kept(file):
    """To leave out what noise takes below 0 would make the dark brighter; `check` tells of it."""
    table = tabulated(METAL)
    table.matrices[4, 1, 2, 0] = np.float32(-1e-3) * np.eye(4)
    store(table, file)
    ds = read(file, every=1)
    assert ds["mueller"].values[:, 0, 0].min() == pytest.approx(-1e-3)
    assert any("m00 = -0.001 is not positive" in str(issue) for issue in check(ds))


def _changed(matrices: np.ndarray, element: tuple[int, ...], value: float) -> np.ndarray:
    matrices = matrices.copy()
    matrices[(4, 1, 2, 1, *element)] = value
    return matrices


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda t: {"wavelength": t.wavelength[::-1]},
            r"wavelengths 500, 450 nm do not ascend: .* sort them",
        ),
        (lambda t: {"wavelength": np.uint16([450, 450])}, "450, 450 nm do not ascend"),
        (lambda t: {"theta_d": t.theta_d[::-1]}, "nodes of theta_d are not two or more ascending"),
        (
            lambda t: {"matrices": _changed(t.matrices, (3, 3), np.nan)},
            r"cell at theta_h = 17\.189°, theta_d = 22\.918°, phi_d = 0° and 500 nm holds no number",
        ),
        (lambda t: {"matrices": _changed(t.matrices, (2, 1), np.inf)}, "500 nm holds no number"),
        (
            lambda t: {"matrices": _changed(t.matrices, (0, 0), -1e-9)},
            r"500 nm has M00 = -1e-09 beside other elements",
        ),
        (
            lambda t: {"matrices": _changed(t.matrices, (0, 0), 0.0)},
            "500 nm has M00 = 0 beside other elements",
        ),
    ],
)
def test_what_the_plugin_would_answer_wrongly_is_not_written(tmp_path, change, words):
    """The path is named and nothing is left of the file."""
    table = filled(tabulated(METAL, GLASS))
    with pytest.raises(DataError, match=rf"wrong\.pbsdf: .*{words}"):
        write_table(replace(table, **change(table)), tmp_path / "wrong.pbsdf")
    assert list(tmp_path.iterdir()) == []


def test_a_cell_that_reflects_nothing_at_all_is_written(tmp_path):
    table = filled(tabulated(METAL))
    table.matrices[4, 1, 2] = 0.0
    write_table(table, tmp_path / "dark.pbsdf")
    assert read_table(tmp_path / "dark.pbsdf").matrices[4, 1, 2, 0, 0, 0] == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"theta_d": None}, "no field 'theta_d': it is not a .pbsdf table"),
        ({"theta_h": np.zeros((1, 5), np.float64)}, "'theta_h' is float64, not float32"),
        ({"wvls": np.float32([450, 500])}, "'wvls' is float32, not uint16"),
        (
            {"wvls": np.array([450], np.uint16)},
            r"'M' has the shape \(9, 4, 5, 2, 4, 4\), but the axes ask for",
        ),
        (
            {"theta_h": np.float32([[0, 0.5, 0.4, 1, 1.2]])},
            "nodes of theta_h are not two or more ascending angles",
        ),
        ({"theta_h": np.float32([[0, np.nan, 0.4, 1, 1.2]])}, "nodes of theta_h are not"),
        ({"theta_d": np.float32([[0, 30, 60, 89]])}, "theta_d reaches 89, .* in degrees"),
        ({"phi_d": np.linspace(-6, 0, 9, dtype=np.float32)[None]}, "nodes of phi_d are not"),
        ({"M": np.full((9, 4, 5, 2, 4, 4), np.nan, np.float32)}, "no cell of the table has a value"),
    ],
)
def test_what_is_wrong_with_a_table_is_told(file, change, words):
    fields = {name: np.array(array) for name, array in read_tensors(file).items()} | change
    write_tensors({name: array for name, array in fields.items() if array is not None}, file)
    with pytest.raises(DataError, match=rf"two\.pbsdf: .*{words}"):
        read(file)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.5, 0.999])
def test_a_truncated_file_is_told(file, share):
    raw = file.read_bytes()
    file.write_bytes(raw[: int(share * len(raw))])
    with pytest.raises(DataError, match=r"two\.pbsdf: .*(truncated|not a tensor file)"):
        read(file)
