"""The table of angles: what it says, what it leaves open, what it refuses."""

import numpy as np
import pytest

from pbrdf.errors import DataError
from pbrdf.instruments.goniometer.angle_table import AngleTable, read_angles, write_angles


@pytest.fixture
def table(tmp_path):
    def read(text):
        (tmp_path / "angles.csv").write_text(text, encoding="utf-8")
        return read_angles(tmp_path / "angles.csv")

    return read


def test_a_full_table(table):
    read = table(
        "# azimuth: forward=0\n# made by hand\n"
        "series, theta_i_deg, theta_r [deg], phi_rad, group, wavelength_nm, exposure, reference_angle, sample_angle\n"
        "a,10,50,0,left,476,1,90,80\n"
        "b,30,20,3.0,right,,0.5,,\n"
    )
    assert read.names == ("a", "b")
    np.testing.assert_array_equal(read.theta_i, np.deg2rad([10, 30]))
    np.testing.assert_array_equal(read.theta_r, np.deg2rad([50, 20]))
    np.testing.assert_array_equal(read.phi, [0.0, 3.0])
    assert read.group.tolist() == ["left", "right"]
    np.testing.assert_array_equal(read.wavelength, [476.0, np.nan])
    np.testing.assert_array_equal(read.exposure, [1.0, 0.5])
    np.testing.assert_array_equal(read.reference_angle, [np.pi / 2, np.nan])
    np.testing.assert_array_equal(read.sample_angle, [np.deg2rad(80), np.nan])


def test_in_the_plane_of_incidence_a_negative_angle_is_on_the_sources_side(table):
    """Without an azimuth θ_r ≥ 0 is forward (φ = 0), θ_r < 0 is |θ_r| on the side of the source (φ = 180°)."""
    read = table("series,theta_i,theta_r\n1,40,30\n2,40,-30\n")
    np.testing.assert_array_equal(read.theta_r, np.deg2rad([30, 30]))
    np.testing.assert_allclose(np.cos(read.phi), [1.0, -1.0])
    assert read.exposure.tolist() == [1.0, 1.0]
    assert read.group.tolist() == [0, 0]
    assert read.wavelength is None


def test_forward_at_180_degrees(table):
    """Where the file counts the azimuth from backscatter, 180° becomes exactly 0."""
    read = table("# azimuth: forward=180\nseries;theta_i;theta_r;phi\n1;40;30;180\n2;40;30;0\n")
    assert read.phi[0] == 0.0
    assert abs(read.phi[1]) == np.pi


def test_a_line_states_radians_for_columns_without_a_unit(table):
    read = table("# Angles: radians\nseries,theta_i,theta_r_deg,phi,wavelength\na,0.5,30,1,476")
    assert (read.theta_i[0], read.phi[0], read.wavelength[0]) == (0.5, 1.0, 476.0)
    assert read.theta_r[0] == pytest.approx(np.pi / 6)


def test_writing_and_reading_again(tmp_path):
    table = AngleTable(
        ("p1_01", "p1_02", "x"),
        np.deg2rad([10.0, 20.0, 30.3]),
        np.deg2rad([0.1, 85.0, 45.0]),
        np.array([0.0, np.pi, 1.2345]),
        ["1", "2", "2"],
        [476.0, 476.0, np.nan],
        [1.0, 0.125, 3.0],
        [np.nan, np.pi / 2, 0.0],
    )
    write_angles(table, tmp_path / "angles.csv")
    read = read_angles(tmp_path / "angles.csv")
    assert read.names == table.names
    for field in (
        "theta_i",
        "theta_r",
        "phi",
        "group",
        "wavelength",
        "exposure",
        "reference_angle",
        "sample_angle",
    ):
        np.testing.assert_array_equal(getattr(read, field), getattr(table, field))
    assert "10.0,0.1" in (tmp_path / "angles.csv").read_text()


def test_rows_of_some_series_in_their_order():
    table = AngleTable(("a", "b", "c"), [0.1, 0.2, 0.3], [0.0, 0.0, 0.0], exposure=[1, 2, 3])
    chosen = table.rows(["c", "a"])
    assert chosen.names == ("c", "a")
    assert chosen.theta_i.tolist() == [0.3, 0.1]
    assert chosen.exposure.tolist() == [3.0, 1.0]
    with pytest.raises(DataError, match="no row for 'd'; it has 'a', 'b', 'c'"):
        table.rows(["d"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("series,theta_i\na,1", "there is no column theta_r"),
        ("series,theta_i,theta_r,tilt\na,1,2,3", "the column 'tilt' is not known; use series, theta_i"),
        ("series,theta_i_nm,theta_r\na,1,2", "the unit of the column 'theta_i_nm' is not understood"),
        ("series,theta_i,theta_r\na,1,two", "line 2, column 'theta_r': 'two' is not a number"),
        ("series,theta_i,theta_r\na,1", "line 2: 2 cells under 3 column names"),
        ("series,theta_i,theta_r\na,1,2\na,1,2", "the series 'a' stands there twice"),
        ("series,theta_i,theta_r\n,1,2", "line 2, column 'series': the cell is empty"),
        ("series,theta_i,theta_r\na,-1,2", "theta_i is negative"),
        ("series,theta_i,theta_r\na,90,2", "series 'a': theta_i is 90, it must be from 0° to below 90°"),
        ("series,theta_i,theta_r,exposure\na,9,2,0", "series 'a': exposure is 0, it must be more than 0"),
        ("# azimuth: backward=0\nseries,theta_i,theta_r\na,9,2", "use forward=0 or forward=180"),
        ("# angles: gon\nseries,theta_i,theta_r\na,9,2", "angles is 'gon'; use degrees or radians"),
        ("series,theta_i,theta_r,sample_angle\na,9,2,1e999", "series 'a': sample_angle is infinite"),
        ("series,theta_i,theta_r,wavelength\na,9,2,inf", "series 'a': wavelength is infinite"),
        ("series,theta_i,theta_r\n", "there are no rows"),
        ("series,theta_i,theta_r,theta_i_deg\na,1,2,3", "two columns are called theta_i"),
    ],
)
def test_what_is_wrong_is_named(table, text, message):
    with pytest.raises(DataError) as caught:
        table(text)
    assert message in str(caught.value)
    assert "angles.csv" in str(caught.value)
