"""The folder beside a map, and the picture while it is made."""

from pathlib import Path

import numpy as np
import pytest
from example_maps import example_map

from pbrdf.inversion.map_store.unit_grid import UnitGrid
from pbrdf.report.parameter_map.folder import write_map_report
from pbrdf.report.parameter_map.quicklook import QuickLook
from pbrdf.report.parameter_map.subject import MapReport


@pytest.mark.slow
def test_the_folder_holds_a_page_with_its_pictures_and_their_files(tmp_path):
    found = example_map((12, 15), parameters=3)
    found["estimate"][1] = 1.5
    report = MapReport(
        found,
        Path("some/where/paint.zarr"),
        ["stokes.nc"],
        {"model": "double-gauss", "share": ["n"], "seed": 0},
        "pbrdf map stokes.nc --share n",
        simulated=True,
    )
    summary, files = write_map_report(report, tmp_path / "page", formats=["pdf"])
    assert summary.fitted == (found["status"] == 0).sum()
    assert {file.name for file in files} == {path.name for path in (tmp_path / "page").iterdir()}
    assert {"map.png", "map.pdf", "quality.png", "parameter_sigma.png"} < {file.name for file in files}
    assert not (tmp_path / "page" / "parameter_n.png").exists()
    page = files[0].read_text(encoding="utf-8")
    for words in (
        "paint.zarr: double-gauss fitted to every pixel",
        "12 (y) × 15 (x) pixels",
        "pbrdf map stokes.nc --share n",
        "Simulated data, not measured.",
        "the same",
        "share: n",
        "open_zarr(&#34;paint.zarr&#34;",
    ):
        assert words in page
    assert page.count("data:image/png;base64,") == 4
    assert summary.sentence in (tmp_path / "page" / "summary.txt").read_text(encoding="utf-8")


def test_without_figures_no_plotting_library_is_asked(tmp_path, monkeypatch):
    monkeypatch.setattr("pbrdf.report.parameter_map.folder._draw", lambda *_: pytest.fail("drawn"))
    report = MapReport(example_map((5, 5)), Path("paint.nc"))
    _, files = write_map_report(report, tmp_path / "page", figures=False)
    assert [file.name for file in files] == ["index.html", "summary.txt"]
    page = files[0].read_text(encoding="utf-8")
    assert "--no-figures" in page
    assert "open_dataset" in page


class Store:
    """What a quick look needs of a store that is being filled."""

    def __init__(self, path, grid):
        self.path, self.grid, self.done = path, grid, set()

    def is_done(self, number):
        return number in self.done


def test_the_quick_look_fills_and_is_drawn_now_and_then(tmp_path, monkeypatch):
    clock, drawn = [100.0], []
    monkeypatch.setattr("pbrdf.report.parameter_map.quicklook.time.monotonic", lambda: clock[0])
    monkeypatch.setattr(
        "pbrdf.report.style.save_figure",
        lambda figure, path: (drawn.append(figure), path.write_bytes(b"png")),
    )
    whole = example_map((40, 40), parameters=2, cause=False)
    stored = whole.copy(deep=True)
    stored["status"][:] = -1
    monkeypatch.setattr("pbrdf.report.parameter_map.quicklook.open_map", lambda path, partial: stored)
    store = Store(
        tmp_path / "paint.zarr", UnitGrid.of({"y": 40, "x": 40}, {"y": 10, "x": 40}, {"y": 10, "x": 40})
    )
    look = QuickLook(store, tmp_path / "report" / "look.png", every=5.0)

    def missing():
        return np.ma.getmaskarray(drawn[-1].axes[0].images[0].get_array()).mean()

    look()
    assert not drawn
    for rows, number in ((slice(0, 10), 0), (slice(20, 30), 2)):
        stored["status"][rows] = 0
        store.done.add(number)
    look()
    assert (tmp_path / "report" / "look.png").read_bytes() == b"png"
    assert missing() == 0.5
    assert "2 of 4 units are done" in drawn[-1].get_suptitle()
    stored["status"][:] = 0
    store.done = {0, 1, 2, 3}
    clock[0] += 1.0
    look()
    assert len(drawn) == 1
    clock[0] += 5.0
    look()
    assert missing() == 0.0
    clock[0] += 50.0
    look()
    assert len(drawn) == 2
