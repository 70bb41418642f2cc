"""What results show in a notebook."""

import xarray as xr

from pbrdf.report.notebook import notebook_html, title_of


def test_text_is_text_whatever_it_says():
    html = notebook_html("a < b", ["<i>", "n"], [["<td>", "&"]], ["</div>"])
    assert html == (
        "<div><p>a &lt; b</p><table><thead><tr><th>&lt;i&gt;</th><th>n</th></tr></thead>"
        "<tbody><tr><td>&lt;td&gt;</td><td>&amp;</td></tr></tbody></table><p>&lt;/div&gt;</p></div>"
    )


def test_data_without_a_title_are_data():
    assert title_of(xr.Dataset(attrs={"title": "Paint"})) == "Paint"
    assert title_of(xr.Dataset(attrs={"title": ""})) == title_of(xr.Dataset()) == "data"
