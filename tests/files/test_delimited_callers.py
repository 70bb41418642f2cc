"""Everything that reads a table understands the same separators, and says where a bad cell stands."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pbrdf.data import read
from pbrdf.errors import DataError
from pbrdf.instruments.calibration.input_table import read_input_table
from pbrdf.instruments.goniometer.angle_table import read_angles
from pbrdf.instruments.polarimeter.analyzer_files import read_analyzer
from pbrdf.instruments.polarimeter.band import read_band
from pbrdf.instruments.reduction.region_files import read_regions

SCATMECH = ["lambda", "thetai", "phi", "thetar", "phir", "f_r11"]
SCATMECH += [f"f_r{i}{j}/f_r11" for i in range(1, 5) for j in range(1, 5)][1:]


def caller(call, names, row, column, value):
    return SimpleNamespace(call=call, names=names, row=row, column=column, value=value)


#: What reads, its columns, a row of them with decimal points, a column of numbers, and what is found of the row.
CALLERS = {
    "csv": caller(
        read,
        ["theta_i_deg", "theta_r_deg", "brdf"],
        ["30.5", "40", "0.75"],
        "brdf",
        lambda ds: [np.rad2deg(ds["theta_i"].values[0]), ds["I"].values[0]],
    ),
    "scatmech": caller(
        read,
        SCATMECH,
        ["0.5", "-30.5", "0", "40", "0", "0.75", *["0.5"] * 15],
        "f_r11",
        lambda ds: [np.rad2deg(ds["theta_i"].values[0]), ds["mueller"].values[0, 0, 0]],
    ),
    "angles": caller(
        read_angles,
        ["series", "theta_i", "theta_r", "exposure"],
        ["a", "30.5", "40", "0.75"],
        "exposure",
        lambda table: [np.rad2deg(table.theta_i[0]), table.exposure[0]],
    ),
    "inputs": caller(
        read_input_table,
        ["series", "I", "Q", "U", "V"],
        ["a", "30.5", "0.75", "0", "0"],
        "Q",
        lambda table: table.stokes[:2, 0],
    ),
    "analyzer": caller(
        read_analyzer,
        ["state", "w_I", "w_Q", "w_U", "w_V"],
        ["a", "30.5", "0.75", "0", "0"],
        "w_Q",
        lambda polarimeter: polarimeter.analyzer[0, :2],
    ),
    "band": caller(
        read_band,
        ["wavelength_nm", "transmission"],
        ["30.5", "0.75"],
        "transmission",
        lambda band: [30.5, 0.75] if band.wavelengths.min() > 30.5 else [],
    ),
    "regions": caller(
        read_regions,
        ["name", "x0", "x1", "y0", "y1"],
        ["a", "0.75", "30.5", "0", "1"],
        "x0",
        lambda regions: [regions["a"].x1, regions["a"].x0],
    ),
}


def rows(kind):
    """One row, but two of a band, which has to have a width."""
    first = CALLERS[kind].row
    return [first, ["31.5", "0.75"]] if kind == "band" else [first]


def text(kind, separator, decimal, rows):
    lines = [CALLERS[kind].names, *([cell.replace(".", decimal) for cell in row] for row in rows)]
    return "".join(separator.join(f'"{cell}"' for cell in line) + "\r\n" for line in lines)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("kind", CALLERS)
def test_separators_decimal_commas_comments_and_byte_order_marks(tmp_path, kind, separator):
    decimal = "." if separator == "," else ","
    content = "\ufeff  # comment\r\n\r\n" + text(kind, separator, decimal, rows(kind)) + "# the end\r\n"
    (tmp_path / "table.csv").write_text(content, encoding="utf-8", newline="")
    found = CALLERS[kind].value(CALLERS[kind].call(tmp_path / "table.csv"))
    np.testing.assert_allclose(found, [30.5, 0.75], rtol=1e-12)


@pytest.mark.parametrize("kind", CALLERS)
def test_the_line_and_the_column_of_a_bad_cell_are_named(tmp_path, kind):
    this = CALLERS[kind]
    bad = list(this.row)
    bad[this.names.index(this.column)] = "0,7x"
    content = "# comment\n\n" + text(kind, ";", ",", [bad])
    (tmp_path / "table.csv").write_text(content, encoding="utf-8", newline="")
    with pytest.raises(
        DataError, match=rf"table\.csv: line 4, column '{this.column}': '0,7x' is not a number"
    ):
        this.call(tmp_path / "table.csv")


@pytest.mark.parametrize("kind", CALLERS)
def test_a_row_of_another_length_is_named(tmp_path, kind):
    content = text(kind, ",", ".", [*rows(kind), CALLERS[kind].row[:-1]])
    (tmp_path / "table.csv").write_text(content, encoding="utf-8", newline="")
    count = len(CALLERS[kind].names)
    line = 2 + len(rows(kind))
    with pytest.raises(DataError, match=rf"table\.csv: line {line}: {count - 1} cells under {count} column"):
        CALLERS[kind].call(tmp_path / "table.csv")
