"""Every picture over the hemisphere has, at sample points, the colour of what mueller() gives there."""

import base64
import math

import numpy as np
import pytest

import pbrdf
from pbrdf.explorer.catalogue import catalogue
from pbrdf.explorer.workspace import Workspace
from pbrdf.models.registry import find_model
from pbrdf.optics.stokes import aolp, dolp

pytestmark = pytest.mark.slow

#: Zenith angles and azimuths of the sample points, degrees: both halves, in the lobe and far from it.
POINTS = ((35.0, 3.0), (50.0, 130.0), (62.0, 250.0))
RANGES = {"intensity": [0.01, 10.0], "dolp": [0.0, 0.5], "u": [-0.5, 0.5], "m11": [-1.0, 1.0]}
DIFFERENCES = {"intensity": [-1.0, 1.0], "dolp": [-0.5, 0.5], "u": [-0.5, 0.5], "m11": [-1.0, 1.0]}
QUANTITIES = ["intensity", "dolp", "aolp", "u", "m11"]
CASES = {
    "natural": {},
    "polarised": {"light": {"theta_i": 35.0, "stokes": [1.0, 0.2, -0.6, 0.5]}},
    "difference": {"compare": 1},
}
# Of each picture the number of its colours, and the pixels nearest to directions with the directions of their middles.
PIXELS = """
points => [...document.querySelectorAll(".board:not(.matrix) figure canvas")].map(canvas => {
  const size = canvas.width, context = canvas.getContext("2d"), reach = 1.16;
  const all = new Uint32Array(context.getImageData(0, 0, size, size).data.buffer);
  const pixels = points.map(([zenith, azimuth]) => {
    const r = zenith / 90 / reach * size / 2, turn = azimuth * Math.PI / 180;
    const i = Math.floor(size / 2 + r * Math.cos(turn)), j = Math.floor(size / 2 - r * Math.sin(turn));
    const x = (i + 0.5 - size / 2) / (size / 2) * reach, y = (size / 2 - j - 0.5) / (size / 2) * reach;
    const rgba = [...context.getImageData(i, j, 1, 1).data];
    return { rgba, zenith: 90 * Math.hypot(x, y), azimuth: Math.atan2(y, x) * 180 / Math.PI };
  });
  return { colours: new Set(all).size, pixels };
})
"""


class Shown(Workspace):
    """A workspace that begins with a changed state."""

    def __init__(self, models, changes):
        super().__init__(models)
        self.changes = changes

    def state(self):
        return {**super().state(), **self.changes}


def tables():
    return {
        name: np.frombuffer(base64.b64decode(text), np.uint8).reshape(256, 4)
        for name, text in catalogue()["colours"].items()
    }


def value(quantity, model, light, zenith, azimuth):
    M = model.mueller(math.radians(light["theta_i"]), math.radians(zenith), math.radians(azimuth))
    S = M @ np.asarray(light["stokes"])
    if quantity == "m11":
        return M[1, 1] / M[0, 0]
    found = {"intensity": math.log10(S[0]), "dolp": dolp(S), "aolp": math.degrees(aolp(S)), "u": S[2] / S[0]}
    return found[quantity]


def colour(quantity, x, difference):
    """The colour of a value."""
    if quantity == "aolp":
        table, share = "cyclic", (x + 90.0) / 180.0 % 1.0
    else:
        low, high = (DIFFERENCES if difference else RANGES)[quantity]
        if quantity == "intensity" and not difference:
            low, high = math.log10(low), math.log10(high)
        sequential = quantity in ("intensity", "dolp") and not difference
        table, share = ("sequential" if sequential else "signed"), (x - low) / (high - low)
    return tables()[table][round(255 * min(max(share, 0.0), 1.0)), :3].astype(float)


@pytest.mark.parametrize("case", CASES)
def test_colours_are_those_of_the_values(served, page, white, case):
    models = [("white", white), ("pearl", pbrdf.load_paint("pearl-white"))]
    difference = case == "difference"
    changes = {
        "quantities": QUANTITIES,
        "settings": {
            "page": {"views": ["hemisphere"]},
            "hemisphere": {"range": DIFFERENCES if difference else RANGES},
        },
        **CASES[case],
    }
    workspace = Shown(models, changes)
    page.goto(served(lambda: workspace))
    page.locator(".board figure canvas").nth(len(QUANTITIES) - 1).wait_for()
    light = workspace.state()["light"]
    pictures = page.evaluate(PIXELS, list(POINTS))
    assert len(pictures) == len(QUANTITIES)
    for quantity, picture in zip(QUANTITIES, pictures, strict=True):
        assert picture["colours"] > 20, f"{quantity} is blank"
        for pixel in picture["pixels"]:
            direction = pixel["zenith"], pixel["azimuth"]
            values = [value(quantity, model, light, *direction) for _, model in models]
            x = values[0] - values[1] if difference else values[0]
            wanted = colour(quantity, x, difference)
            *found, opaque = pixel["rgba"]
            assert opaque == 255
            # two steps of 256 of a table whose steps are three bytes at most, and interpolation between directions
            np.testing.assert_allclose(found, wanted, atol=8.0, err_msg=f"{quantity} at {direction}")


def test_reading_values_by_keyboard_and_pointer(served, page, white):
    changes = {"settings": {"page": {"views": ["hemisphere", "mueller"]}}}
    page.goto(served(lambda: Shown([("white", white)], changes)))
    board = page.locator(".board:not(.matrix)")
    square = board.locator(".square").first
    square.locator("canvas").wait_for()
    board.focus()
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowUp")
    said = page.locator(".readout").inner_text()
    zenith, azimuth = math.hypot(11.0, 1.0), math.degrees(math.atan2(1.0, 11.0))
    S = white.stokes(math.radians(35.0), math.radians(zenith), math.radians(azimuth))
    assert f"θ {zenith:.3g}°, φ {azimuth:.3g}°" in said
    assert f"Intensity {S[0]:.3g}" in said
    assert "DoLP" in said
    page.keyboard.press("Escape")
    box = square.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert page.locator(".readout").inner_text().startswith("θ 0")
    # the matrix: sixteen elements, of which one is chosen among the pictures
    cells = page.locator(".board.matrix button")
    assert cells.count() == 16
    cells.nth(5).click()
    page.get_by_text("m₁₁/m₀₀", exact=True).wait_for()
    assert cells.nth(5).get_attribute("aria-pressed") == "true"


def test_where_nothing_is_polarised_there_is_no_angle(served, page, white):
    """Along the normal an isotropic surface in light along it polarises nothing: no colour, and no number."""
    changes = {
        "quantities": ["aolp"],
        "light": {"theta_i": 0.0, "stokes": [1.0, 0.0, 0.0, 0.0]},
        "settings": {"page": {"views": ["hemisphere"]}},
    }
    page.goto(served(lambda: Shown([("white", white)], changes)))
    board = page.locator(".board")
    board.locator("canvas").first.wait_for()
    middle, far = page.evaluate(PIXELS, [[0.0, 0.0], [70.0, 20.0]])[0]["pixels"]
    assert middle["rgba"][3] < 10 and far["rgba"][3] == 255
    board.focus()
    page.keyboard.press("ArrowRight")
    assert page.locator(".readout").inner_text() == "θ 1°, φ 0° · AoLP none"
    for _ in range(7):
        page.keyboard.press("Shift+ArrowRight")
    # body light comes out polarised along p
    assert page.locator(".readout").inner_text() == "θ 71°, φ 0° · AoLP 0°"


def test_light_along_s_is_at_plus_90_degrees(served, page):
    """The end of the range that belongs to it, in the plane of incidence and everywhere around the normal."""
    kind = find_model("priest-germer")
    mirror = kind.from_values({p.name: p.default for p in kind.parameters})
    changes = {"quantities": ["aolp"], "settings": {"page": {"views": ["hemisphere"]}}}
    page.goto(served(lambda: Shown([("mirror", mirror)], changes)))
    board = page.locator(".board")
    board.locator("canvas").first.wait_for()
    board.focus()
    for _ in range(4):
        page.keyboard.press("Shift+ArrowRight")
    assert page.locator(".readout").inner_text() == "θ 40°, φ 0° · AoLP 90°"


def test_where_there_is_no_light_no_number_is_read(served, page):
    """A surface without body light is black far from its lobe: neither dark nor polarised in numbers."""
    kind = find_model("priest-germer")
    mirror = kind.from_values({p.name: p.default for p in kind.parameters})
    changes = {"settings": {"page": {"views": ["hemisphere"]}, "fit": {"held": 5}, "data": {"off": 5}}}
    page.goto(served(lambda: Shown([("mirror", mirror)], changes)))
    board = page.locator(".board")
    board.locator("canvas").first.wait_for()
    board.focus()
    for _ in range(7):
        page.keyboard.press("Shift+ArrowLeft")
    assert page.locator(".readout").inner_text() == "θ 70°, φ 180° · no light"
