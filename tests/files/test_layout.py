"""Layouts of tables of text, as instruments, spreadsheets and programs write them, with the numbers in them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pbrdf.errors import DataError
from pbrdf.files.delimited import column_names, read_table

NAMES = ["theta_i", "theta_r", "phi", "brdf"]
NUMBERS = [[30.0, 20.0, 0.0, 0.3], [30.0, 30.0, 180.0, 0.5], [45.5, -30.0, 0.0, 1.25e-3]]
DECIMAL = ["30 20 0 0.3", "30 30 180 0.5", "45.5 -30 0 1.25e-3"]


def rows(separator, lines=DECIMAL, comma=False):
    text = "".join(line.replace(" ", separator) + "\n" for line in lines)
    return text.replace(".", ",") if comma else text


@pytest.fixture
def table(tmp_path):
    def read(text, encoding="utf-8"):
        path = tmp_path / "table.dat"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        found = read_table(path)
        assert column_names(path) == found.names
        return found

    return read


LAYOUTS = {
    "one blank": "theta_i theta_r phi brdf\n" + rows(" "),
    "vertical bars": "theta_i|theta_r|phi|brdf\n" + rows(" | "),
    "a line under the names": "theta_i theta_r phi brdf\n" + 24 * "-" + "\n" + rows(" "),
    "lines under the names": "theta_i theta_r phi brdf\n" + 4 * "======= " + "\n" + rows(" "),
    "several blanks": "  theta_i  theta_r   phi brdf\n" + "".join(f"   {x}  \n" for x in rows("   ").split("\n")[:-1]),
    "tabs and blanks": "theta_i\ttheta_r phi  \tbrdf\n" + rows(" \t"),
    "aligned by blanks, separated by commas": "theta_i, theta_r,  phi,  brdf\n" + rows(" , "),
    "commas in names, blanks in rows": "# theta_i, theta_r, phi, brdf\n" + rows(" "),
    "blanks in names, commas in rows": "theta_i theta_r phi brdf\n" + rows(","),
    "tabs in names, blanks in rows": "theta_i\ttheta_r\tphi\tbrdf\n" + rows("   "),
    "commas in names, tabs in rows": "Lamp 3\ntheta_i, theta_r, phi, brdf\n" + rows("\t"),
    "units in words": "theta_i,theta_r,phi,brdf\nDegrees,Degrees,Degrees,per sr\n" + rows(","),
    "numpy.savetxt": "# theta_i,theta_r,phi,brdf\n" + rows(","),
    "names in a comment of Matlab": "% measured in May\n% theta_i theta_r phi brdf\n" + rows(" "),
    "names in a comment of C": "// theta_i;theta_r;phi;brdf\n" + rows(";"),
    "names in a comment with semicolon": "; theta_i theta_r phi brdf\n" + rows(" "),
    "names in a comment with exclamation mark": "! theta_i\ttheta_r\tphi\tbrdf\n" + rows("\t"),
    "names in a comment, said to be": "# Columns: theta_i, theta_r, phi, brdf\n" + rows(","),
    "names in a comment before statements": "# theta_i,theta_r,phi,brdf\n# quantity: brdf\n# illumination: 1,0,0,0\n"
    + rows(","),
    "names in a comment, units in the next": "# theta_i theta_r phi brdf\n# deg deg deg 1/sr\n" + rows(" "),
    "names, units in a comment": "theta_i,theta_r,phi,brdf\n# deg, deg, deg, 1/sr\n" + rows(","),
    "a row of units": "theta_i,theta_r,phi,brdf\ndeg,deg,deg,1/sr\n" + rows(","),
    "a row of units in brackets": "theta_i;theta_r;phi;brdf\n[deg];[deg];[deg];[1/sr]\n" + rows(";"),
    "a row of units with gaps": "theta_i\ttheta_r\tphi\tbrdf\n°\t°\t\t1/sr\n" + rows("\t"),
    "a row of units, of which one is 1": "theta_i,theta_r,phi,brdf\ndeg,deg,deg,1\n" + rows(","),
    "names in a comment, a row of units": "# theta_i,theta_r,phi,brdf\ndeg,deg,deg,1/sr\n" + rows(","),
    "Origin": "theta_i\ttheta_r\tphi\tbrdf\ndeg\tdeg\tdeg\t1/sr\n\t\t\twhite paint\n" + rows("\t"),
    "a title": "My measurement of a white paint\ntheta_i,theta_r,phi,brdf\n" + rows(","),
    "a title with commas after it": "My measurement,,,\ntheta_i,theta_r,phi,brdf\n" + rows(","),
    "two rows of names": "angle,angle,angle,Stokes\ntheta_i,theta_r,phi,brdf\n" + rows(","),
    "prose": "Goniometer 7, software 2.3\nMeasured on Monday, by A. B., at 22 degrees\n\n"
    "theta_i,theta_r,phi,brdf\n" + rows(","),
    "prose before blanks": "Measured on Monday by A B\nthe lamp was on\n\ntheta_i theta_r phi brdf\n" + rows(" "),
    "keys and values": "Operator,Smith\nDate,2024-05-01\nAverages,10\nGain,2\n\ntheta_i,theta_r,phi,brdf\n" + rows(","),
    "keys and values, semicolons": "Operator;Smith\nAverages;10\ntheta_i;theta_r;phi;brdf\n" + rows(";", comma=True),
    "keys: values": "Operator: Smith\nTemperature: 21,5\n[Data]\ntheta_i;theta_r;phi;brdf\n" + rows(";", comma=True),
    "LabVIEW": "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n***End_of_Header***\t\n"
    "Channels\t4\t\t\t\nSamples\t3\t3\t3\t3\n***End_of_Header***\t\t\t\t\n"
    "theta_i\ttheta_r\tphi\tbrdf\tComment\n" + rows("\t", comma=True),
    "Excel's line of the separator": "sep=;\ntheta_i;theta_r;phi;brdf\n" + rows(";"),
    "a separator at all ends": "theta_i,theta_r,phi,brdf,\n" + rows(",").replace("\n", ",\n"),
    "a separator at the ends of rows": "theta_i,theta_r,phi,brdf\n" + rows(",").replace("\n", ",\n"),
    "a separator at the end of names": "theta_i,theta_r,phi,brdf,\n" + rows(","),
    "separators at some ends": "theta_i,theta_r,phi,brdf\n" + rows(",").replace("0.3\n", "0.3,,,\n"),
    "decimal commas and semicolons": "theta_i;theta_r;phi;brdf\n" + rows(";", comma=True),
    "decimal commas and tabs": "theta_i\ttheta_r\tphi\tbrdf\n" + rows("\t", comma=True),
    "decimal commas and blanks": "theta_i theta_r phi brdf\n" + rows("  ", comma=True),
    "quoted": '"theta_i","theta_r","phi","brdf"\n' + "".join(
        ",".join(f'"{c}"' for c in line.split()) + "\n" for line in DECIMAL
    ),
    "quoted and separated by blanks": '"theta_i" "theta_r" "phi" "brdf"\n' + "".join(
        " ".join(f'"{c}"' for c in line.split()) + "\n" for line in DECIMAL
    ),
    "Fortran": "theta_i theta_r phi brdf\n" + rows("  ").replace("e-3", "D-03"),
    "a form feed between pages": "theta_i theta_r phi brdf\n" + rows(" ").replace("\n", "\n\f", 2),
    "minus signs and spaces of typesetters": "theta_i;theta_r;phi;brdf\n"
    + rows(";").replace("-", "\u2212").replace(";", "\u00a0;"),
    "comments between rows": "theta_i,theta_r,phi,brdf\n" + rows(",").replace("\n", "\n# next\n\n"),
}  # fmt: skip


@pytest.mark.parametrize("text", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_layouts(table, text, end):
    found = table(text.replace("\n", end))
    assert found.names == NAMES
    numbers = np.stack([found.numbers(column) for column in range(4)], axis=-1)
    assert_array_equal(numbers, NUMBERS)
    assert [[found.number(row, column) for column in range(4)] for row in range(3)] == NUMBERS
    for row in range(3):
        line = text.split("\n")[found.lines[row] - 1]
        assert ("30" if row < 2 else "45") in line


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16", "utf-16-le", "utf-16-be"]
)
def test_encodings(table, encoding):
    found = table("# size: 5 µm\ntheta_i [°];theta_r [°]\n30,5;−1\n".replace("−", "-"), encoding)
    assert found.names == ["theta_i [°]", "theta_r [°]"]
    assert found.comments == [(1, "# size: 5 µm")]
    assert found.numbers(0).tolist() == [30.5]


@pytest.mark.parametrize(
    ("kind", "units"),
    [
        ("a row of units", ["deg", "deg", "deg", "1/sr"]),
        ("a row of units in brackets", ["[deg]", "[deg]", "[deg]", "[1/sr]"]),
        ("a row of units with gaps", ["°", "°", "", "1/sr"]),
        ("a row of units, of which one is 1", ["deg", "deg", "deg", "1"]),
        ("names in a comment, units in the next", ["deg", "deg", "deg", "1/sr"]),
        ("names in a comment, a row of units", ["deg", "deg", "deg", "1/sr"]),
        ("names, units in a comment", ["deg", "deg", "deg", "1/sr"]),
        ("Origin", ["deg", "deg", "deg", "1/sr"]),
        ("a title", None),
        ("numpy.savetxt", None),
    ],
)
def test_rows_of_units(table, kind, units):
    assert table(LAYOUTS[kind]).units == units


def test_names_of_components_are_no_units(table):
    found = table("s,V\n1,2\n")
    assert (found.names, found.units) == (["s", "V"], None)
    assert table("deg,counts\n1,2\n3,4\n").names == ["deg", "counts"]


def test_remarks_before_the_names_are_kept_and_told(table):
    found = table(LAYOUTS["keys and values"])
    assert found.comments[:2] == [(1, "# Operator: Smith"), (2, "# Date: 2024-05-01")]
    assert found.names_line == 6
    assert found.statements_end == 6
    assert found.warnings == [
        "lines 1 to 4 of the file ('Operator: Smith' …) were taken as remarks, not as data"
    ]
    assert table(LAYOUTS["Origin"]).warnings == [
        "line 3 of the file ('white paint') was taken as a remark, not as data"
    ]
    for quiet in ("one blank", "numpy.savetxt", "a row of units", "Excel's line of the separator"):
        assert table(LAYOUTS[quiet]).warnings == []


def test_statements_may_follow_names_in_a_comment(table):
    found = table(LAYOUTS["names in a comment before statements"])
    assert (found.names_line, found.statements_end) == (1, 4)
    assert table("a,b\n# later: 1\n1,2\n").statements_end == 1


def test_two_columns_of_keys_and_values_before_two_of_numbers(table):
    found = table("Operator,Smith\nAverages,10\nGain,2\nwavelength_nm,transmission\n500,0.1\n510,0.2\n")
    assert found.names == ["wavelength_nm", "transmission"]
    assert found.numbers(0).tolist() == [500.0, 510.0]


def test_names_that_are_numbers(table):
    found = table("theta_i,theta_r,450,550.5\n30,20,0.1,0.2\n30,30,0.3,0.4\n")
    assert found.names == ["theta_i", "theta_r", "450", "550.5"]
    assert found.numbers(3).tolist() == [0.2, 0.4]
    assert table("# theta_i theta_r 450 550\n30 20 0.1 0.2\n").names == ["theta_i", "theta_r", "450", "550"]


def test_names_with_blanks_in_tables_separated_by_blanks(table):
    assert table("theta_i [deg] theta_r [deg] I (1/sr)\n30 20 0.1\n").names == [
        "theta_i [deg]", "theta_r [deg]", "I (1/sr)",
    ]  # fmt: skip
    assert table("Incident Zenith   Viewing Zenith   BRF\n 30   20   0.1\n").names == [
        "Incident Zenith", "Viewing Zenith", "BRF",
    ]  # fmt: skip


def test_rows_that_R_numbers(table):
    found = table('"theta_i" "brdf"\n"1" 30 0.5\n"2" 40 0.25\n')
    assert found.names == ["", "theta_i", "brdf"]
    assert found.numbers(2).tolist() == [0.5, 0.25]


def test_names_over_several_lines_of_a_cell(table):
    assert table('"theta_i\n[deg]",brdf\n30,0.5\n').names == ["theta_i [deg]", "brdf"]


def test_rows_of_text_are_rows(table):
    found = table("series,angle_deg,handedness\nleft,,left\nright,,right\nlinear0,0,\n")
    assert found.names[0] == "series"
    assert [row.text("series") for row in found] == ["left", "right", "linear0"]
    assert table("a,b\nx,y\nz,w\n").rows == [["x", "y"], ["z", "w"]]
    assert table("# series, x\na,1\nb,2\n").names == ["series", "x"]


def test_gaps_stay_gaps(table):
    found = table("a\tb\tc\n1\t\t3\n\t2\t\n")
    assert found.rows == [["1", "", "3"], ["", "2", ""]]
    assert_array_equal(found.numbers(1, missing=("",)), [np.nan, 2.0])
    with pytest.raises(DataError, match="line 2, column 'b': '' is not a number"):
        found.numbers(1)
    # A column without a value keeps its place if it has a name.
    assert table("a,b,c\n1,2,\n3,4,\n").names == ["a", "b", "c"]


@pytest.mark.parametrize("text", ["30,20,0.3\n30,30,0.5\n", "30 20 0.3\n", "# remark\n30\t20\t0.3\n"])
def test_numbers_are_never_taken_for_names(table, tmp_path, text):
    with pytest.raises(
        DataError, match=r"line \d: numbers stand here, but no line above them has the 3 names of columns"
    ):
        table(text)
    assert column_names(tmp_path / "table.dat") == []


def test_prose_over_numbers_without_names(table):
    with pytest.raises(DataError, match="line 2: numbers stand here, but no line above them has the 4 names"):
        table("Measured on Monday\n30 20 0 0.3\n")


def test_an_error_of_a_spreadsheet_in_the_first_column_is_no_comment(table):
    found = table("a,b\n1,2\n#DIV/0!,3\n#N/A,4\n")
    with pytest.raises(DataError, match="line 3, column 'a': '#DIV/0!' is not a number"):
        found.numbers(0)


def test_a_page_of_html_is_told(table):
    with pytest.raises(DataError, match="line 1: this is XML or HTML; save it as CSV or as a workbook"):
        table("<html><table><tr><td>1</td></tr></table>\n")


def test_a_file_that_ends_within_a_row_is_cut_off(table):
    with pytest.raises(
        DataError, match=r"line 3: 2 cells under 3 column names; the file ends there .* cut off"
    ):
        table("a,b,c\n1,2,3\n1,2")
    with pytest.raises(DataError, match=r"line 3: 2 cells under 3 column names$"):
        table("a,b,c\n1,2,3\n1,2\n")


@pytest.mark.parametrize(
    ("cells", "told"),
    [
        (["0.1234", "0.2345", "0.3456", "0.45"], True),
        (["0.1234", "0.2345", "0.3456", "0.456"], True),
        (["0.1234", "0.2345", "0.3456", "0.4567"], False),
        (["0.123456", "0.2345", "0.34567", "0.456"], False),
        (["0.1", "0.2", "3"], False),
        (["0.12345"], False),
    ],
)
def test_a_file_that_ends_within_its_last_number(table, cells, told):
    found = table("a,b\n" + "\n".join(f"1,{cell}" for cell in cells))
    assert bool(found.warnings) == told
    if told:
        assert f"line {len(cells) + 1}: the last number, {cells[-1]!r}, has fewer digits" in found.warnings[0]
    assert table("a,b\n" + "".join(f"1,{cell}\n" for cell in cells)).warnings == []


@pytest.mark.parametrize("separator", [",", " ", ";"])
@pytest.mark.parametrize("end", ["", "\n"])
def test_words_below_the_rows_are_remarks(table, separator, end):
    text = "a b c\n1 2 3\n4 5 6\n".replace(" ", separator)
    found = table(f"{text}\nEnd of\n***{end}")
    assert found.lines == [2, 3]
    assert found.warnings[0].startswith("lines 5 to 6 of the file ('End of")


@pytest.mark.parametrize("more", ["7,8\n", "End,7\n", "End\n7,8,9\n", "e,n,d,!\n"])
def test_what_has_numbers_is_no_remark_below_the_rows(table, more):
    with pytest.raises(DataError, match=r"line 4: . cells under 3 column names"):
        table("a,b,c\n1,2,3\n4,5,6\n" + more)


def test_words_that_end_without_a_line_end_may_be_a_row(table):
    with pytest.raises(DataError, match=r"line 3: 1 cells under 3 column names; .* cut off"):
        table("a,b,c\nwhite,2,3\nwhi")


def test_the_beginning_of_a_large_file_is_enough_for_its_names(tmp_path):
    path = tmp_path / "large.csv"
    path.write_text("theta_i,theta_r,brdf\n" + "30,20,0.5\n" * 150_000)
    assert column_names(path) == ["theta_i", "theta_r", "brdf"]
