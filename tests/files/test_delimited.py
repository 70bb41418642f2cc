"""Tables of delimited columns: what separates, what a number is, and where in the file a message points to."""

from __future__ import annotations

import math

import pytest

from pbrdf.errors import DataError
from pbrdf.files.delimited import column_names, read_table, write_table


@pytest.fixture
def table(tmp_path):
    def read(text, encoding="utf-8"):
        (tmp_path / "table.csv").write_text(text, encoding=encoding, newline="")
        return read_table(tmp_path / "table.csv")

    return read


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_each_separator(table, separator):
    found = table(f"a{separator}b\n1.5{separator}x y\n")
    assert found.names == ["a", "b"]
    assert found.rows == [["1.5", "x y"]]
    assert found.number(0, 0) == 1.5
    assert found.decimal_comma == (separator != ",")


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_where_they_separate_nothing(table, separator):
    found = table(f"a{separator}b{separator}c{separator}d\n" + separator.join(("1,5", "-,25e-1", "2.5", "3")))
    assert [found.number(0, column) for column in range(4)] == [1.5, -0.025, 2.5, 3.0]


def test_a_decimal_comma_between_commas_is_a_row_too_long(table):
    with pytest.raises(DataError, match=r"table\.csv: line 2: 3 cells under 2.*decimal commas.*semicolons"):
        table("a,b\n1,5,2\n")


def test_a_comma_that_marks_thousands_is_no_number(table):
    with pytest.raises(DataError, match=r"line 2, column 'a': '1\.234,5' is not a number"):
        table("a;b\n1.234,5;2\n").number(0, 0)


def test_white_space_and_quotation_marks_around_cells(table):
    found = table('"a, of b" ; c \n "1,5" ; x \n"two\nlines";"he said ""no"""\n')
    assert found.names == ["a, of b", "c"]
    assert found.rows == [["1,5", "x"], ["two\nlines", 'he said "no"']]
    assert found.lines == [2, 3]


def test_a_separator_within_quotation_marks_is_none(table):
    assert table('"a,b,c";d\n1;2\n').names == ["a,b,c", "d"]


def test_comments_and_empty_lines_count_for_the_numbers_of_lines_only(table):
    found = table("# first: 1\n\n  # second\na,b\n#third\n1,2\n\n,\n3,4\n")
    assert (found.names, found.names_line, found.lines) == (["a", "b"], 4, [6, 9])
    assert found.comments == [(1, "# first: 1"), (3, "# second"), (5, "#third")]
    assert found.numbers(1).tolist() == [2.0, 4.0]


def test_byte_order_mark_and_line_ends(table):
    for end in ("\r\n", "\r", "\n"):
        found = table(f"a,b{end}1,2{end}3,4{end}", encoding="utf-8-sig")
        assert (found.names, found.lines) == (["a", "b"], [2, 3])


@pytest.mark.parametrize("row", ["1,2", "1,2,3,4"])
def test_a_ragged_row_is_named(table, row):
    with pytest.raises(DataError, match=rf"table\.csv: line 3: {len(row.split(','))} cells under 3"):
        table(f"a,b,c\n1,2,3\n{row}\n")


def test_a_cell_that_is_no_number_is_named(table):
    found = table('a,"b c"\n"x\ny",2\n3,four\n,6\n')
    for row, column, message in (
        (0, 0, r"table\.csv: line 2, column 'a': 'x\\ny' is not a number"),
        (1, 1, r"table\.csv: line 4, column 'b c': 'four' is not a number"),
        (2, 0, r"table\.csv: line 5, column 'a': '' is not a number"),
    ):
        with pytest.raises(DataError, match=message):
            found.number(row, column)
    with pytest.raises(DataError, match="line 5, column 'a': the cell is empty"):
        found.text(2, 0)
    assert math.isnan(found.number(2, 0, missing=("",)))


def test_texts_that_mean_nothing_measured(table):
    values = table("a\nNA\n nan\n1\n").numbers(0, missing=("na",))
    assert math.isnan(values[0])
    assert math.isnan(values[1])
    assert values[2] == 1.0


def test_rows_by_the_names_of_the_columns(table):
    first, second = table("a;b\n1,5;\n;x\n")
    assert (first.number("a"), first.get("b"), first.get("c")) == (1.5, "", "")
    assert second.text("b") == "x"
    assert second.line.endswith("table.csv: line 3")
    assert second.place("a").endswith("table.csv: line 3, column 'a'")
    with pytest.raises(DataError, match="line 2, column 'b': the cell is empty"):
        first.text("b")
    with pytest.raises(DataError, match="line 3, column 'a': '' is not a number"):
        second.number("a")


def test_a_column_that_is_missing_or_double_is_refused_when_it_is_asked_for(table):
    found = table("a,b,b\n1,2,3\n")
    assert found.column("a") == 0
    with pytest.raises(DataError, match=r"table\.csv: two columns are called 'b'"):
        found.column("b")
    with pytest.raises(DataError, match=r"table\.csv: there is no column 'c'; the columns are a, b, b"):
        found.column("c")


@pytest.mark.parametrize("text", ["", "\n# nothing\n", ",,\n"])
def test_a_file_without_column_names_is_refused(table, text):
    with pytest.raises(DataError, match=r"table\.csv: there is no line of column names"):
        table(text)


def test_a_table_may_be_without_rows_until_they_are_required(table):
    found = table("a,b\n")
    assert len(found) == 0
    with pytest.raises(DataError, match=r"table\.csv: there are no rows under the column names"):
        found.require_rows()


def test_a_quotation_mark_left_open_is_named(table):
    for rows in (3, 50_000):
        with pytest.raises(
            DataError, match=r"line 3: a cell .* does not end; is a quotation mark left open\?"
        ):
            table('a,b\n1,2\n"3,4\n' + "5,6\n" * rows)


def test_some_rows_keep_their_lines(table):
    found = table("a\n1\n\n2\n3\n").taken([2, 0])
    assert (found.numbers(0).tolist(), found.lines) == ([3.0, 1.0], [5, 2])


def test_names_alone_are_read_of_anything(tmp_path):
    path = tmp_path / "file"
    for content, names in (
        (b"\xef\xbb\xbf# c\n\na; b\n1;2\n", ["a", "b"]),
        (b"", []),
        (b"\x89HDF\r\n\x1a\n\xff\x00\xfe", []),
        (b"PK\x03\x04, b\n1,2\n", []),
    ):
        path.write_bytes(content)
        assert column_names(path) == names
    assert column_names(tmp_path / "none") == []
    assert column_names(tmp_path) == []


def test_what_is_written_is_read(tmp_path):
    rows = [["x, y", "1.5"], ['"q"', ""], ["# no comment", "2"]]
    write_table(tmp_path / "out.csv", ["a", "b"], rows, {"key": "value: 1"})
    assert (tmp_path / "out.csv").read_text().startswith("# key: value: 1\na,b\n")
    assert [path.name for path in tmp_path.iterdir()] == ["out.csv"]
    found = read_table(tmp_path / "out.csv")
    assert found.names == ["a", "b"]
    assert found.rows == rows
