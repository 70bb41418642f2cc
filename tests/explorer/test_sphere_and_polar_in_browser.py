"""The ball and the polar surface in Chromium: pixels against the Mueller matrix, the dial, turning, lamps."""

import numpy as np
import pytest

from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.state import Light
from pbrdf.explorer.views import sphere
from pbrdf.explorer.workspace import Workspace
from pbrdf.instruments.pixel_geometry.camera import Lamp

expect = pytest.importorskip("playwright.sync_api").expect
pytestmark = pytest.mark.slow

BALL, POLAR = "article[aria-label='Lit ball'] canvas", "article[aria-label='Polar surface'] canvas"
#: Colours of places of a canvas, from its middle in half widths, x to the right and y up; in bytes.
READ = """([selector, places]) => {
    const canvas = document.querySelector(selector), copy = document.createElement("canvas");
    const pen = copy.getContext("2d");
    copy.width = canvas.width;
    copy.height = canvas.height;
    pen.drawImage(canvas, 0, 0);
    const pixels = pen.getImageData(0, 0, canvas.width, canvas.height).data;
    return places.map(([x, y]) => {
        const column = Math.round((x + 1) * canvas.width / 2 - 0.5);
        const row = Math.round((1 - y) * canvas.height / 2 - 0.5);
        const at = 4 * (row * canvas.width + column);
        return [...pixels.subarray(at, at + 4)];
    });
}"""
#: Rows of the grid and columns of half a turn: places of a ball of 1/1.02 of half the canvas.
SHAPE = (90, 91)
PLACES = [(20, 10), (45, 140), (60, 30)]


@pytest.fixture
def opened(served, page, white):
    state = state_of([layer_of("white", white), layer_of("rough", white.replace(sigma=0.2))])

    class Given(Workspace):
        def state(self):
            return state

    page.set_viewport_size({"width": 800, "height": 900})
    page.goto(served(Given))
    for view in ("Lit ball", "Polar surface"):
        expect(page.locator(f"article[aria-label='{view}'] .colour-legend")).not_to_have_text(
            "", timeout=30000
        )
    return page


def places(lamp):
    found = []
    for row, column in PLACES:
        radius = np.sin(np.deg2rad(sphere.RIM) * row / (SHAPE[0] - 1)) / 1.02
        angle = lamp.azimuth + np.pi * column / (SHAPE[1] - 1)
        found.append([radius * np.cos(angle), radius * np.sin(angle)])
    return found


def colours(page, selector, where):
    return np.array(page.evaluate(READ, [selector, where]))[:, :3]


def radiance(bytes_):
    """What the tone curve made of it, before the exposure's factor π."""
    x = np.asarray(bytes_) / 255.0
    linear = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return -np.log1p(-linear) / np.pi


def test_the_ball(opened, white):
    page = opened
    lamp = Lamp(*np.deg2rad(sphere.LAMP))
    field = sphere.picture(white, lamp, Light(), "total", SHAPE)
    expected = np.array([field[row, column] for row, column in PLACES])
    where = places(lamp)
    mode = page.get_by_role("group", name="What the ball shows")

    def typed(name):
        return page.locator(f"[data-place='settings.sphere.{name}'] input.number")

    natural = radiance(colours(page, BALL, where))[:, 0]
    np.testing.assert_allclose(natural, expected[:, 0], rtol=0.03, atol=1e-3)

    # the dial turns without an answer of Dr.Jit; both pictures together are the one without polariser
    mode.get_by_label("Polariser").check()
    through = {}
    for angle in (0, 90, 45):
        typed("polariser").fill(str(angle))
        typed("polariser").press("Enter")
        through[angle] = radiance(colours(page, BALL, where))[:, 0]
        c, s = np.cos(np.deg2rad(2 * angle)), np.sin(np.deg2rad(2 * angle))
        passed = 0.5 * expected[:, 0] * (1.0 + c * expected[:, 1] + s * expected[:, 2])
        np.testing.assert_allclose(through[angle], passed, rtol=0.03, atol=1e-3)
    np.testing.assert_allclose(through[0] + through[90], natural, rtol=0.03, atol=1e-3)

    # the colour table has at these places the degree of polarisation of its range, whose end the legend says
    mode.get_by_label("DoLP").check()
    most = (
        float(page.locator("article[aria-label='Lit ball'] .colour-legend span").last.inner_text().split()[0])
        / 100
    )
    from matplotlib import colormaps

    dolp = np.hypot(expected[:, 1], expected[:, 2])
    table = np.round(colormaps["cividis"](dolp / most)[:, :3] * 255.0)
    np.testing.assert_allclose(colours(page, BALL, where), table, atol=4)
    mode.get_by_label("AoLP").check()
    angle = 0.5 * np.arctan2(expected[:, 2], expected[:, 1])
    clear = dolp > 0.011
    assert clear.any()
    table = np.round(colormaps["twilight"](0.5 + angle / np.pi)[:, :3] * 255.0)
    np.testing.assert_allclose(colours(page, BALL, where)[clear], table[clear], atol=6)

    # what the pointer reads, and that it drags the lamp along
    page.locator(BALL).first.scroll_into_view_if_needed()
    box = page.locator(BALL).first.bounding_box()
    x, y = where[1]
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    at = (middle[0] + x * box["width"] / 2, middle[1] - y * box["height"] / 2)
    page.mouse.move(*at)
    said = page.locator("article[aria-label='Lit ball'] .read").inner_text()
    assert float(said.split()[0]) == pytest.approx(expected[1, 0], rel=0.02)
    page.mouse.down()
    page.mouse.move(middle[0], middle[1] - 0.3 * box["height"], steps=3)
    page.mouse.up()
    # the ball mirrors the lamp where the pointer is: 0.612 radii above the middle
    assert float(typed("light.polar").input_value()) == pytest.approx(75.4, abs=1.5)
    assert float(typed("light.azimuth").input_value()) == pytest.approx(90.0, abs=1.5)


def test_the_polar_surface(opened):
    page = opened
    page.locator("article[aria-label='Polar surface']").scroll_into_view_if_needed()
    grid = [[x, y] for x in np.linspace(-0.9, 0.9, 61) for y in np.linspace(-0.9, 0.9, 61)]

    def picture():
        return np.array(page.evaluate(READ, [POLAR, grid]))

    first = picture()
    assert len({tuple(pixel) for pixel in first}) > 20
    canvas = page.locator(POLAR).first
    canvas.focus()
    page.keyboard.press("ArrowLeft")
    assert (picture() != first).any()
    page.keyboard.press("Home")
    np.testing.assert_array_equal(picture(), first)
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2 + 30, steps=3)
    page.mouse.up()
    assert (picture() != first).any()
    page.get_by_role("group", name="Scale").get_by_label("log").check()
    surface = page.locator("article[aria-label='Polar surface']")
    expect(surface.locator(".colour-legend")).to_contain_text("decades")
    page.mouse.move(box["x"] + box["width"] * 0.55, box["y"] + box["height"] * 0.55)
    expect(surface.locator(".read")).to_contain_text("Intensity")
    page.locator("select[name=polar-quantity]").select_option("dolp")
    expect(page.locator("article[aria-label='Polar surface'] .colour-legend")).to_contain_text("DoLP")
    assert len({tuple(pixel) for pixel in picture()}) > 20
    assert " net: rough" in page.locator("article[aria-label='Polar surface']").inner_text()
