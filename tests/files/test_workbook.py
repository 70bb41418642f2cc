"""Sheets of workbooks as tables."""

from __future__ import annotations

import zipfile
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pbrdf.data import read
from pbrdf.errors import DataError
from pbrdf.files.delimited import column_names, read_table
from pbrdf.instruments.goniometer.angle_table import read_angles

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
RELATIONS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"


class Error(str):
    """A cell in error."""


class Date(float):
    """A number that is shown as a date."""


def xlsx_cell(place, value):
    if isinstance(value, Error):
        return f'<c r="{place}" t="e"><v>{value}</v></c>'
    if isinstance(value, Date):
        return f'<c r="{place}" s="1"><v>{float(value)!r}</v></c>'
    if isinstance(value, bool):
        return f'<c r="{place}" t="b"><v>{int(value)}</v></c>'
    if isinstance(value, str):
        return f'<c r="{place}" t="inlineStr"><is><t xml:space="preserve">{escape(value)}</t></is></c>'
    return f'<c r="{place}"><v>{value!r}</v></c>'


def write_xlsx(path, sheets):
    def rows(cells):
        for r, row in enumerate(cells, 1):
            inner = "".join(
                xlsx_cell(f"{chr(65 + c)}{r}", value) for c, value in enumerate(row) if value is not None
            )
            yield f'<row r="{r}">{inner}</row>'

    names = list(sheets)
    with zipfile.ZipFile(path, "w") as archive:
        types = "".join(
            f'<Override PartName="/xl/worksheets/sheet{k}.xml" '
            'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>'
            for k in range(1, len(names) + 1)
        )
        archive.writestr(
            "[Content_Types].xml",
            f'<Types xmlns="{PACKAGE}/content-types"><Default Extension="rels" '
            'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            '<Override PartName="/xl/workbook.xml" '
            'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>'
            f"{types}</Types>",
        )
        archive.writestr(
            "_rels/.rels",
            f'<Relationships xmlns="{PACKAGE}/relationships"><Relationship Id="rId1" '
            f'Type="{RELATIONS}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        )
        listed = "".join(f'<sheet name="{n}" sheetId="{k}" r:id="rId{k}"/>' for k, n in enumerate(names, 1))
        archive.writestr(
            "xl/workbook.xml",
            f'<workbook xmlns="{MAIN}" xmlns:r="{RELATIONS}"><sheets>{listed}</sheets></workbook>',
        )
        targets = "".join(
            f'<Relationship Id="rId{k}" Type="{RELATIONS}/worksheet" Target="worksheets/sheet{k}.xml"/>'
            for k in range(1, len(names) + 1)
        )
        styles = f'<Relationship Id="rId99" Type="{RELATIONS}/styles" Target="styles.xml"/>'
        archive.writestr(
            "xl/_rels/workbook.xml.rels",
            f'<Relationships xmlns="{PACKAGE}/relationships">{targets}{styles}</Relationships>',
        )
        archive.writestr(
            "xl/styles.xml",
            f'<styleSheet xmlns="{MAIN}"><cellXfs><xf numFmtId="0"/><xf numFmtId="14"/></cellXfs></styleSheet>',
        )
        for k, cells in enumerate(sheets.values(), 1):
            archive.writestr(
                f"xl/worksheets/sheet{k}.xml",
                f'<worksheet xmlns="{MAIN}"><sheetData>{"".join(rows(cells))}</sheetData></worksheet>',
            )


def write_ods(path, sheets):
    def cell(value):
        if value is None:
            return "<table:table-cell/>"
        if isinstance(value, str):
            return f'<table:table-cell office:value-type="string"><text:p>{escape(value)}</text:p></table:table-cell>'
        return f'<table:table-cell office:value-type="float" office:value="{value!r}"/>'

    office = "urn:oasis:names:tc:opendocument:xmlns"
    body = "".join(
        f'<table:table table:name="{name}">'
        + "".join(f"<table:table-row>{''.join(map(cell, row))}</table:table-row>" for row in cells)
        + "</table:table>"
        for name, cells in sheets.items()
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr(
            "META-INF/manifest.xml",
            f'<manifest:manifest xmlns:manifest="{office}:manifest:1.0"></manifest:manifest>',
        )
        archive.writestr(
            "content.xml",
            f'<office:document-content xmlns:office="{office}:office:1.0" xmlns:table="{office}:table:1.0" '
            f'xmlns:text="{office}:text:1.0"><office:body><office:spreadsheet>{body}</office:spreadsheet>'
            "</office:body></office:document-content>",
        )


#: A row with the text "far" alone.
FAR = '<table:table-row><table:table-cell office:value-type="string"><text:p>far</text:p>'


def change_part(path, name, old, new, behind=""):
    """Replace text within a part of a workbook, and put some behind it."""
    with zipfile.ZipFile(path) as archive:
        parts = {part: archive.read(part).decode() for part in archive.namelist()}
    assert old in parts[name]
    parts[name] = parts[name].replace(old, new, 1) + behind
    with zipfile.ZipFile(path, "w") as archive:
        for part, content in parts.items():
            archive.writestr(part, content)


TABLE = [
    ["theta_i", "theta_r", "phi", "brdf"],
    ["deg", "deg", "deg", "1/sr"],
    [30.0, 20.0, 0.0, 0.1 + 0.2],
    [30.0, 30.0, 180.0, 0.5],
]
WRITERS = {".xlsx": write_xlsx, ".ods": write_ods}


@pytest.mark.parametrize("kind", WRITERS)
def test_a_sheet_is_a_table(tmp_path, kind):
    path = tmp_path / f"data{kind}"
    WRITERS[kind](path, {"Notes": [["measured by A. B."], ["in May"]], "Data": [["a title"], [None], *TABLE]})
    found = read_table(path)
    assert (found.names, found.sheet, found.units) == (TABLE[0], "Data", TABLE[1])
    assert found.lines == [5, 6]
    assert found.numbers(3).tolist() == [0.1 + 0.2, 0.5]
    ds = read(path)
    assert_array_equal(ds["I"], [0.1 + 0.2, 0.5])
    assert_array_equal(np.rad2deg(ds["phi"]), [0.0, 180.0])
    assert column_names(path) == []


def test_a_workbook_is_known_by_its_content(tmp_path):
    write_xlsx(tmp_path / "data.csv", {"Data": TABLE})
    assert read(tmp_path / "data.csv").sizes["geometry"] == 2


def test_a_table_that_begins_somewhere_in_the_sheet(tmp_path):
    write_xlsx(tmp_path / "t.xlsx", {"Data": [[None] * 6, *([None, None, *row] for row in TABLE)]})
    found = read_table(tmp_path / "t.xlsx")
    assert (found.names, found.lines) == (TABLE[0], [4, 5])


def test_several_sheets_with_numbers_are_asked_for(tmp_path):
    path = tmp_path / "t.xlsx"
    other = [TABLE[0], [10.0, 20.0, 0.0, 0.9]]
    write_xlsx(path, {"white": TABLE, "black": other})
    with pytest.raises(
        DataError, match=r"t\.xlsx: the sheets 'white', 'black' all hold numbers; name one with sheet"
    ):
        read(path)
    write_xlsx(path, {"white": TABLE, "ranges": [["from 0 to", 90.0], [0.0, 90.0]], "black": other})
    with pytest.raises(DataError, match="the sheets 'white', 'black' all hold numbers"):
        read(path)
    write_xlsx(tmp_path / "one.xlsx", {"ranges": [[0.0, 90.0], [0.0, 90.0]], "black": other})
    assert read(tmp_path / "one.xlsx")["I"].values.tolist() == [0.9]
    assert read(path, sheet="black")["I"].values.tolist() == [0.9]
    with pytest.raises(
        DataError, match="there is no sheet 'grey'; the sheets are 'white', 'ranges', 'black'"
    ):
        read(path, sheet="grey")
    (tmp_path / "t.csv").write_text("theta_i,theta_r,brdf\n30,20,0.5\n")
    with pytest.raises(DataError, match=r"t\.csv: this is a text, which has no sheets"):
        read(tmp_path / "t.csv", sheet="black")
    write_xlsx(path, {"Notes": [["words"]], "Empty": []})
    with pytest.raises(DataError, match=r"t\.xlsx: no sheet holds numbers"):
        read(path)


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        ("0.5x", "0.5x"), (True, "TRUE"), (Error("#DIV/0!"), "#DIV/0!"), (Date(45413.0), "2024-05-01"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("column", [0, 3])
def test_cells_that_are_no_numbers_are_named_with_sheet_and_row(tmp_path, cell, shown, column):
    path = tmp_path / "t.xlsx"
    bad = list(TABLE[3])
    bad[column] = cell
    write_xlsx(path, {"Data": [*TABLE[:3], bad]})
    words = rf"t\.xlsx: sheet 'Data': line 4, column '{TABLE[0][column]}': '{shown}' is not a number"
    with pytest.raises(DataError, match=words):
        read(path)


def test_numbers_as_text_and_gaps(tmp_path):
    path = tmp_path / "t.xlsx"
    write_xlsx(path, {"Data": [TABLE[0], ["30,5", "20.5", 0, 0.25], [], [30.0, 20.0, 0.0, None]]})
    ds = read(path)
    assert_array_equal(ds["I"], [0.25, np.nan])
    assert_array_equal(np.rad2deg(ds["theta_i"]), np.rad2deg(np.deg2rad([30.5, 30.0])))


def test_other_tables_may_be_workbooks_too(tmp_path):
    write_xlsx(
        tmp_path / "a.xlsx", {"S": [["series", "theta_i", "theta_r", "group"], ["x", 30.0, 40.0, 7.0]]}
    )
    table = read_angles(tmp_path / "a.xlsx")
    assert (table.names, table.group.tolist()) == (("x",), [7])


def test_damaged_workbooks_are_told_in_one_line(tmp_path):
    path = tmp_path / "t.xlsx"
    write_xlsx(path, {"Data": TABLE})
    whole = path.read_bytes()
    damaged = [
        whole[: len(whole) // 2],
        whole[:100],
        b"PK\x03\x04",
        bytes.fromhex("d0cf11e0a1b11ae1") + bytes(600),
    ]
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(DataError, match=r"t\.xlsx: cannot be read as a workbook") as told:
            read_table(path)
        assert "\n" not in str(told.value)


def test_a_workbook_that_unpacks_to_too_much_is_not_read(tmp_path, monkeypatch):
    path = tmp_path / "t.xlsx"
    write_xlsx(path, {"Data": TABLE})
    monkeypatch.setattr("pbrdf.files.workbook._MOST_BYTES", 1000)
    with pytest.raises(DataError, match=r"t\.xlsx: it unpacks to .* GiB, more than any workbook"):
        read_table(path)


def test_a_cell_far_away_is_told_instead_of_filling_the_memory(tmp_path, monkeypatch):
    path = tmp_path / "t.xlsx"
    monkeypatch.setattr("pbrdf.files.workbook._MOST_CELLS", 1000)
    write_xlsx(path, {"Data": [*TABLE, *[[None]] * 400, [None, None, None, 0.0]]})
    with pytest.raises(DataError, match=r"t\.xlsx: a sheet reaches to row 405 and column 4, mostly empty"):
        read_table(path)
    write_xlsx(path, {"Data": [*TABLE, *[[None]] * 200, [None, None, 10.0, None]]})
    assert len(read_table(path)) == 3


def test_cells_of_an_open_document_that_are_repeated_far_away_are_told(tmp_path, monkeypatch):
    path = tmp_path / "t.ods"
    monkeypatch.setattr("pbrdf.files.workbook._MOST_CELLS", 1000)
    write_ods(path, {"Data": [*TABLE, ["far"]]})
    change_part(path, "content.xml", FAR, FAR.replace("row", 'row table:number-rows-repeated="400"', 1))
    with pytest.raises(DataError, match=r"t\.ods: a sheet reaches to row 404 and column 4, mostly empty"):
        read_table(path)
    # what a spreadsheet program writes below and beside the last cell
    write_ods(path, {"Data": [*TABLE, [None]]})
    empty = FAR.partition("<table:table-cell")[0]
    repeated = (
        '<table:table-row table:number-rows-repeated="1048572">'
        '<table:table-cell table:number-columns-repeated="16384"/>'
    )
    change_part(path, "content.xml", f"{empty}<table:table-cell/>", repeated)
    assert len(read_table(path)) == 2


def test_a_part_of_a_workbook_that_is_no_xml_is_named(tmp_path):
    for path, part, write in (
        (tmp_path / "t.ods", "content.xml", write_ods),
        (tmp_path / "t.xlsx", "xl/worksheets/sheet1.xml", write_xlsx),
    ):
        write(path, {"Data": TABLE})
        change_part(path, part, "", "", behind="<open>")
        with pytest.raises(DataError, match=rf"{path.name}: cannot be read as .* its part {part} is damaged"):
            read_table(path)


def test_the_example_of_a_stranger(measured):
    found = read_table(Path(measured("strangers/panel-BRFs.csv")))
    assert found.names == ["Relative Azimuth", "Viewing Zenith", "Incident Zenith", "Wavelength", "Panel BRF"]
    assert found.numbers(4).tolist() == [1.09, 1.05, 1.09]
