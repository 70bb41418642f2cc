"""Measured data in the browser: curves beside the points, points switched off, a fit, and the way back."""

import re

import numpy as np
import pytest

import pbrdf
from pbrdf.data import make_dataset
from pbrdf.explorer.workspace import Workspace

pytestmark = pytest.mark.slow

expect = pytest.importorskip("playwright.sync_api").expect
PATIENCE = 60_000


def numbers(text):
    return [float(n) for n in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", text.replace("−", "-"))]


class Plot:
    """One of the small plots as it is drawn: from units of the drawing back to values."""

    def __init__(self, tab, index):
        self.tab, self.node = tab, tab.locator("svg.cut").nth(index)

    def ticks(self):
        """Values and places of the labels at both axes of the curves."""
        up = self.node.locator(".words").first.locator("text[text-anchor=end]")
        along = self.node.locator(".words").last.locator("text:not(.axis)")
        return [
            [(numbers(mark.text_content())[0], float(mark.get_attribute(side))) for mark in marks.all()]
            for marks, side in ((up, "y"), (along, "x"))
        ]

    def curve(self, index, logarithmic):
        """Places along the axis and values of a curve."""
        up, along = self.ticks()
        inside = self.node.locator("> svg").first
        top, left = float(inside.get_attribute("y")), float(inside.get_attribute("x"))
        path = inside.locator("path[stroke]").nth(index).get_attribute("d")
        x, y = np.array(numbers(path.replace("M", " ").replace("L", " "))).reshape(-1, 2).T
        values = np.array([np.log10(v) if logarithmic else v for v, _ in up])
        slope, start = np.polyfit([place - 4.0 for _, place in up], values, 1)
        stretch, zero = np.polyfit([place for _, place in along], [v for v, _ in along], 1)
        found = slope * (y + top) + start
        return stretch * (x + left) + zero, 10.0**found if logarithmic else found


def opened(served, page, make):
    page.goto(served(make))
    page.wait_for_selector("svg.cut path[stroke]", timeout=PATIENCE)


def test_curves_are_those_of_mueller(served, page, white):
    pearl = pbrdf.load_paint("pearl-white")
    opened(served, page, lambda: Workspace([("white", white), ("pearl", pearl)]))
    samples = np.array([-50.0, 35.0, 62.0])
    for index, model in enumerate((white, pearl)):
        M = model.mueller(np.deg2rad(35.0), np.deg2rad(np.abs(samples)), np.where(samples < 0.0, np.pi, 0.0))
        x, intensity = Plot(page, 0).curve(index, logarithmic=True)
        # a tenth of a pixel of some 200 over the decades of the axis
        np.testing.assert_allclose(np.interp(samples, x, intensity), M[:, 0, 0], rtol=0.01)
        x, dolp = Plot(page, 1).curve(index, logarithmic=False)
        expected = np.hypot(M[:, 1, 0], M[:, 2, 0]) / M[:, 0, 0]
        np.testing.assert_allclose(np.interp(samples, x, dolp), expected, atol=2e-3)
    # by keyboard the values are said, four digits of them
    plots = page.locator(".plots")
    plots.focus()
    page.keyboard.press("Home")
    for _ in range(9):
        page.keyboard.press("ArrowRight")
    said = plots.get_attribute("aria-valuetext")
    there = float(plots.get_attribute("aria-valuenow"))
    value = float(re.search(r"white ([\d.]+)", said)[1])
    assert value == pytest.approx(
        white.mueller(np.deg2rad(35.0), np.deg2rad(abs(there)), np.pi if there < 0.0 else 0.0)[0, 0], rel=5e-3
    )


def test_points_are_switched_off_by_keyboard_and_a_fit_can_be_undone(served, page, white):
    ds = pbrdf.open_experiment("matte-white-thick")
    displaced = white.replace(sigma=0.07, n=1.5)
    opened(served, page, lambda: Workspace([("white", displaced)], [("measured", ds)]))
    plots = page.locator(".plots")
    plots.focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    said = plots.get_attribute("aria-valuetext")
    assert said.startswith("used, ")
    # what is said is the data's own number
    told = float(re.search(r"measured ([\d.]+)", said)[1])
    assert np.abs(ds["I"].values - told).min() < 1e-4
    page.keyboard.press("Space")
    expect(plots).to_have_attribute("aria-valuetext", re.compile("^switched off"), timeout=PATIENCE)
    assert page.locator("svg.cut").first.locator(".mark-off").count() >= 1
    assert page.get_by_role("button", name="Switch 1 point on again").is_enabled()

    page.get_by_label("group 3").check()
    page.get_by_role("button", name="Fit from here").click()
    page.wait_for_selector(".fitting .verdict", timeout=PATIENCE)
    used = ds.isel(geometry=np.flatnonzero(np.abs(ds["I"].values - told) > 1e-4))
    result = pbrdf.fit(used, displaced, starts=16, hold_out="group=3")
    table = page.locator(".fitting .estimates").inner_text().replace("−", "-")
    estimate = result.estimates["sigma"]
    assert f"{estimate.value:.4f}"[:5] in table and "±" in table
    assert page.locator(".fitting .correlation tbody td").count() == result.correlation.size
    text = page.locator(".fitting").inner_text()
    assert result.verdict().sentence in text
    assert "held out: group=3 (21 geometries)" in text
    slider = page.locator("input[type=range][name=sigma]")
    stands = slider.evaluate("node => node.getAttribute('aria-valuetext') ?? node.value")
    assert numbers(stands)[0] == pytest.approx(estimate.value, rel=0.01)
    page.get_by_role("button", name=re.compile("^Undo")).click()
    stands = slider.evaluate("node => node.getAttribute('aria-valuetext') ?? node.value")
    assert numbers(stands)[0] == pytest.approx(0.07)
    page.get_by_role("button", name="Take the fitted values over again").click()
    stands = slider.evaluate("node => node.getAttribute('aria-valuetext') ?? node.value")
    assert numbers(stands)[0] == pytest.approx(estimate.value, rel=0.01)


def test_a_fit_goes_to_its_own_model_though_others_have_gone(served, page, white):
    models = [
        ("other", white.replace(n=1.5)),
        ("mine", white.replace(n=1.9)),
        ("third", white.replace(n=2.2)),
    ]
    workspace = Workspace(models, [("measured", pbrdf.open_experiment("matte-white-thick"))])
    state = {**workspace.state(), "active": 1}
    state["settings"] = {"page": {"views": ["cuts"]}, "fit": {"starts": 1}}
    workspace.state = lambda: state
    page.goto(served(lambda: workspace))
    page.get_by_role("button", name="Fit from here").click()
    # before the process beside has even been told
    page.get_by_label("Remove other").click()
    page.wait_for_selector(".fitting .verdict", timeout=PATIENCE)
    expect(page.get_by_label("n, number")).not_to_have_value("1.9")
    page.get_by_label("edit third").check()
    expect(page.get_by_label("n, number")).to_have_value("2.2")


def test_light_follows_the_chosen_line_and_settings_of_other_data_are_given_up(served, page, white):
    theta_i = np.deg2rad(np.repeat([30.0, 60.0], 9))
    s = np.deg2rad(np.tile(np.linspace(-40.0, 40.0, 9), 2))
    phi = np.where(s < 0.0, np.pi, 0.0)
    S = white.stokes(theta_i, np.abs(s), phi)
    ds = make_dataset(theta_i, np.abs(s), phi, quantity="brdf", I=S[:, 0], Q=S[:, 1], U=S[:, 2])
    workspace = Workspace([("white", white)], [("scan", ds)])
    state = workspace.state()
    state["settings"] = {"data": {"set": "gone", "off": [400]}}
    workspace.state = lambda: state
    opened(served, page, lambda: workspace)
    expect(page.locator(".curves")).to_contain_text("no data called 'gone' are open here", timeout=PATIENCE)
    page.get_by_role("button", name="Show what is open").click()
    line = page.get_by_label("Along", exact=True)
    expect(line.locator("option")).to_have_count(4, timeout=PATIENCE)
    page.get_by_label("light follows").check()
    line.select_option(label="θi = 60°")
    expect(page.get_by_label("θᵢ, number")).to_have_value("60", timeout=PATIENCE)
    # nine points in each of two plots, twice each, and one that explains them
    expect(page.locator(".curves .mark-used")).to_have_count(37, timeout=PATIENCE)
    page.get_by_label("60°", exact=True).check()
    expect(page.locator(".curves .mark-held")).to_have_count(37, timeout=PATIENCE)
    # the table says and does the same
    page.locator(".curves summary").click()
    box = page.get_by_label("use the point at −40°")
    box.uncheck()
    expect(page.locator(".curves .mark-off").first).to_be_visible(timeout=PATIENCE)
    expect(page.get_by_role("button", name="Switch 1 point on again")).to_be_enabled()
