"""The outline of a ball or a cylinder in a picture: circle and straight edges, found without being told where.

The picture is S0, the brightest of the series at each pixel, so that what one lamp leaves dark another one shows; a
saturated pixel counts as bright. The sample is brighter or darker than what is behind it. Several thresholds are tried:
a few per cent above (below) what stands along the picture's border, and Otsu's between the two commonest brightnesses
(IEEE Trans. Syst. Man Cybern. 9, 62, 1979); of the connected parts, the larger ones are looked at. A circle or two
parallel lines are searched in the outline points by random samples (Fischler and Bolles, Commun. ACM 24, 381, 1981),
so that the border of the shadow, which bends inwards, and things beside do not count; then moved to where the
brightness steps, and fitted by least squares of the distances with outliers weighted down.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import PixelCamera

__all__ = ["Bar", "Circle", "find_bar", "find_circle", "sample_picture"]

#: Larger pictures are averaged down to about so many pixels to look for the sample; numbers read at a time.
_MOST_PIXELS, _READ = 2**21, 2**22
#: Steps above the background that are tried, in parts of the picture's range, the lower ones for dark samples with
#: bright highlights; and the least, in noise of the background.
_STEPS, _NOISE = (0.03, 0.003, 0.0003), 6.0
#: The same for the sharpness of an edge, in parts of the sample's median.
_RISE, _RISE_NOISE = 0.06, 3.0
#: Connected parts of the picture that are looked at, by size.
_PARTS = 3
#: Random samples of outline points; they are the same ones in every run.
_TRIALS = 400
#: Smaller balls and cylinders are highlights, or specks; pixels of the picture averaged down.
_LEAST_RADIUS = 4.0
#: What an outline must have in common with the circle: share of the whole circle, of the outline, of the area.
_ARC, _SHARE, _INSIDE = 0.25, 0.35, 0.9
#: Half the length of the profile across an outline, in pixels.
_REACH = 4.0
#: By which pixels, and the interpolation between them, blur a profile: standard deviation in pixels.
_BLUR = 0.45
_SECTORS = 72
_NOT_ROUND = (
    "no round outline was found in the picture: give the ball's place and radius in pixels, x, y and r (a ball that is "
    "lit from behind, cut off by the picture or before a background as bright is not found)"
)
_NOT_STRAIGHT = (
    "no two straight edges were found in the picture: give the cylinder's place, half width and direction, x, y, r "
    "(pixels) and angle"
)
_SOFT_EDGE = (
    "one of the cylinder's edges is not sharp, as where its shadow begins: give x, y, r and angle, or add a picture "
    "with a lamp that lights that edge"
)


@dataclass(frozen=True)
class Circle:
    """A ball's outline, as :class:`~pbrdf.instruments.pixel_geometry.sphere.Sphere` says it.

    Attributes
    ----------
    x, y, r
        Pixels.
    arc
        Share of the circle on which outline points were found.
    residual
        Root mean square distance of these from the circle, pixels.
    """

    x: float
    y: float
    r: float
    arc: float
    residual: float


@dataclass(frozen=True)
class Bar:
    """Two straight edges.

    Attributes
    ----------
    x, y
        In the middle between them, and of their length, pixels.
    half_width
        Half their distance there, pixels.
    angle
        Of their middle line from the horizontal, counterclockwise, radians within (−π/2, π/2].
    length
        Along the middle line; None if it leaves the picture at both ends.
    edges
        Two points (x, y) on each, shape (2, 2, 2).
    residual
        Root mean square distance of the outline points from the lines, pixels.
    """

    x: float
    y: float
    half_width: float
    angle: float
    length: float | None
    edges: np.ndarray
    residual: float


@dataclass(frozen=True)
class _Picture:
    """A picture whose pixels are `step` of the whole one along each side."""

    values: np.ndarray
    step: int

    def place(self, points: np.ndarray) -> np.ndarray:
        """Places (x, y) in the whole picture of indices (column, row), shapes (..., 2)."""
        return (points + 0.5) * self.step


def sample_picture(stokes: xr.Dataset) -> tuple[np.ndarray, int]:
    """S0 to look for a sample in: the brightest of the series at each pixel, of large pictures means of square blocks.

    Returns
    -------
    values, step
        Shape (rows, columns), NaN where nothing was measured; `step` pixels along each side are one.

    Raises
    ------
    DataError
        If nothing was measured anywhere.
    """
    # here, as most geometries look for nothing in a picture
    from pbrdf.instruments.reduction.stokes_image import PixelFlag

    rows, columns = stokes.sizes["y"], stokes.sizes["x"]
    step = max(1, math.ceil(math.sqrt(rows * columns / _MOST_PIXELS)))
    brightest = np.full((rows // step, columns // step), -np.inf)
    saturated = np.zeros(brightest.shape, dtype=bool)
    height = max(1, _READ // (columns * step))
    for i in range(stokes.sizes.get("series", 1)):
        one = stokes.isel(series=i) if "series" in stokes.dims else stokes
        for first in range(0, len(brightest), height):
            part = slice(first, first + height)
            block = one.isel(y=slice(first * step, min(first + height, len(brightest)) * step))
            values = _blocks(block["I"], step)
            count = np.isfinite(values).sum(axis=(1, 3))
            mean = np.nansum(values, axis=(1, 3)) / np.maximum(count, 1)
            brightest[part] = np.fmax(brightest[part], np.where(count > 0, mean, np.nan))
            if "flags" in one:
                saturated[part] |= ((_blocks(block["flags"], step) & PixelFlag.SATURATED) != 0).any(
                    axis=(1, 3)
                )
    found = np.isfinite(brightest)
    if not found.any():
        raise DataError("no pixel was measured: there is nothing to find in the picture")
    brightest = np.where(found, brightest, np.nan)
    return np.where(saturated, np.nanmax(brightest), brightest), step


def _blocks(array: xr.DataArray, step: int) -> np.ndarray:
    """Square blocks of whole pictures, shape (rows, step, columns, step); what is left over at the end is cut off."""
    values = array.transpose("y", "x").values
    rows, columns = (n // step for n in values.shape)
    return values[: rows * step, : columns * step].reshape(rows, step, columns, step)


def find_circle(stokes: xr.Dataset, camera: PixelCamera) -> Circle:
    """The outline of a ball.

    Parameters
    ----------
    stokes
        Pictures, see :class:`~pbrdf.instruments.pixel_geometry.geometry.PixelGeometry`.
    camera
        Of the size of the pictures.

    Raises
    ------
    DataError
        If no part of the picture has a round outline.
    """
    picture = _Picture(*sample_picture(stokes))
    found: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []
    for part, values in _parts(picture.values):
        points = _outline(part)
        circle = _sampled_circle(points, part)
        if circle is None:
            continue
        off = np.abs(_distance(circle, points))
        close = off < _tolerance(circle[2])
        arc = _arc(circle, points[close])
        share = close.mean()
        rows, columns = np.nonzero(part)
        inside = (np.hypot(columns - circle[0], rows - circle[1]) < circle[2] + 1.5).mean()
        if arc < _ARC or share < _SHARE or inside < _INSIDE:
            continue
        found.append((arc * share * inside * math.sqrt(circle[2]), circle, part, values))
    # the best of those whose edge is sharp
    for _, circle, part, values in sorted(found, key=lambda one: -one[0]):
        precise = _precise_circle(circle, part, values, picture, camera)
        if precise is not None:
            return precise
    raise DataError(_NOT_ROUND)


def find_bar(stokes: xr.Dataset) -> Bar:
    """The two straight edges of a cylinder; parameters and errors as :func:`find_circle` has."""
    picture = _Picture(*sample_picture(stokes))
    found: list[tuple[float, list[np.ndarray], np.ndarray, np.ndarray, np.ndarray]] = []
    for part, values in _parts(picture.values):
        points = _outline(part)
        lines = _sampled_lines(points)
        if lines is None:
            continue
        close = [np.abs(_inside(line, points)) < 1.5 for line in lines]
        share = (close[0] | close[1]).mean()
        # nothing may lie outside of the two edges, and they must not be those of something else
        rows, columns = np.nonzero(part)
        off = [columns * line[0] + rows * line[1] - line[2] for line in lines]
        between = ((off[0] > -2.0) & (off[1] > -2.0)).mean()
        if share < 0.5 or between < _INSIDE:
            continue
        length = min(c.sum() for c in close)
        width = abs(_inside(lines[0], points[close[1]].mean(axis=0)))
        if width < 2.0 * _LEAST_RADIUS:
            continue
        found.append((share * between * math.sqrt(length * width), lines, points, part, values))
    if not found:
        raise DataError(_NOT_STRAIGHT)
    for _, lines, points, part, values in sorted(found, key=lambda one: -one[0]):
        precise = _precise_bar(lines, points, part, values, picture)
        if precise is not None:
            return precise
    raise DataError(_SOFT_EDGE)


def _parts(values: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Connected parts of the picture that may be the sample, and the picture in which they are the brighter ones."""
    from scipy import ndimage

    filled = np.where(np.isfinite(values), values, np.nanmedian(values))
    low, high = np.percentile(filled, (0.5, 99.5))
    border = np.concatenate([filled[0], filled[-1], filled[1:-1, 0], filled[1:-1, -1]])
    background = np.median(border)
    noise = 1.4826 * np.median(np.abs(border - background))
    for sign in (1.0, -1.0):
        signed, ends = sign * filled, sorted((sign * low, sign * high))
        span = ends[1] - sign * background
        if not span > 0.0:
            continue
        levels = {sign * background + max(step * span, _NOISE * noise) for step in _STEPS}
        for level in (*sorted(levels), _otsu(np.clip(signed, *ends))):
            marks, count = ndimage.label(signed > level)
            if not count:
                continue
            sizes = np.bincount(marks.ravel())[1:]
            for i in np.argsort(sizes)[::-1][:_PARTS]:
                part = ndimage.binary_fill_holes(marks == i + 1)
                if part.sum() >= 50:
                    yield part, signed


def _otsu(values: np.ndarray) -> float:
    """The threshold that leaves the least variance within the pixels below and above it."""
    counts, edges = np.histogram(values, 256)
    middle = 0.5 * (edges[1:] + edges[:-1])
    below = np.cumsum(counts)
    above = below[-1] - below
    total = np.cumsum(counts * middle)
    with np.errstate(divide="ignore", invalid="ignore"):
        between = below * above * (total / below - (total[-1] - total) / above) ** 2
    return float(edges[1 + np.argmax(np.nan_to_num(between[:-1]))])


def _outline(part: np.ndarray) -> np.ndarray:
    """Indices (column, row) of a part's outermost pixels, without those on the picture's border; shape (N, 2)."""
    from scipy import ndimage

    rim = part & ~ndimage.binary_erosion(part, border_value=1)
    rim[[0, -1]] = False
    rim[:, [0, -1]] = False
    rows, columns = np.nonzero(rim)
    return np.stack([columns, rows], axis=-1).astype(float)


def _tolerance(radius: Any) -> Any:
    """How far from the circle an outline pixel may lie, of one radius or of several."""
    return np.maximum(1.2, 0.01 * radius)


def _distance(circle: np.ndarray, points: np.ndarray) -> np.ndarray:
    values: np.ndarray = np.hypot(points[:, 0] - circle[0], points[:, 1] - circle[1]) - circle[2]
    return values


def _arc(circle: np.ndarray, points: np.ndarray) -> float:
    """Share of the circle's sectors in which there are points."""
    turn = np.arctan2(points[:, 1] - circle[1], points[:, 0] - circle[0]) / (2.0 * np.pi)
    return len(np.unique(np.floor((turn % 1.0) * _SECTORS))) / _SECTORS


def _sampled_circle(points: np.ndarray, part: np.ndarray) -> np.ndarray | None:
    """The circle (x, y, r) through three outline points that most others lie on."""
    if len(points) < 12:
        return None
    rng = np.random.default_rng(0)
    thin = points if len(points) <= 2000 else rng.choice(points, 2000, replace=False)
    three = thin[np.stack([rng.choice(len(thin), 3, replace=False) for _ in range(_TRIALS)])]
    a, b = three[:, 1] - three[:, 0], three[:, 2] - three[:, 0]
    cross = 2.0 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        aa, bb = (a * a).sum(-1), (b * b).sum(-1)
        centre = (
            np.stack([b[:, 1] * aa - a[:, 1] * bb, a[:, 0] * bb - b[:, 0] * aa], axis=-1) / cross[:, None]
        )
    radius = np.hypot(*centre.T)
    centre += three[:, 0]
    usable = np.isfinite(radius) & (radius > _LEAST_RADIUS) & (radius < 2.0 * max(part.shape))
    if not usable.any():
        return None
    circles = np.concatenate([centre, radius[:, None]], axis=-1)[usable]
    # the border of a shadow lies inside of the outline: of circles with as many points the one around the others
    off = np.hypot(thin[:, 0] - circles[:, :1], thin[:, 1] - circles[:, 1:2]) - circles[:, 2:]
    limit = _tolerance(circles[:, 2:])
    votes = (np.abs(off) < limit).sum(-1) - (off > limit).sum(-1)
    circle: np.ndarray = circles[np.argmax(votes)]
    for _ in range(5):
        close = np.abs(_distance(circle, points)) < _tolerance(circle[2])
        if close.sum() < 12:
            return None
        circle = _algebraic_circle(points[close])
    return circle


def _algebraic_circle(points: np.ndarray) -> np.ndarray:
    """Least squares of x² + y² − 2ax − 2by − c about the points' middle (Kåsa 1976): the start of a better one."""
    middle = points.mean(axis=0)
    shifted = points - middle
    system = np.concatenate([2.0 * shifted, np.ones((len(points), 1))], axis=-1)
    a, b, c = np.linalg.lstsq(system, (shifted**2).sum(-1), rcond=None)[0]
    return np.array([a + middle[0], b + middle[1], math.sqrt(max(c + a * a + b * b, 0.0))])


def _crossings(values: np.ndarray, points: np.ndarray, outward: np.ndarray, span: float) -> np.ndarray:
    """How far outwards of outline points the edge of the sample is, pixels; NaN where it is not sharp.

    Towards the rim of a round body the brightness runs on as the cosine of the incidence does, by a constant and the
    square root of the distance from the edge; behind the edge it is that of the background. This, blurred by the
    pixels, is fitted to the profile across the outline with the edge at many places, of which the best is taken.

    Where a shadow begins the brightness rises slowly: there, the places at which it is once and three times a small
    part of the picture's range above the background lie apart; at an edge they do not.

    Parameters
    ----------
    values
        In which the sample is the brighter side.
    points, outward
        Indices (column, row) and unit vectors, shapes (N, 2).
    span
        Of the sample above the background.
    """
    from scipy import ndimage

    along = np.linspace(-_REACH, _REACH, 81)
    where = points[:, None] + along[:, None] * outward[:, None]
    profile = ndimage.map_coordinates(values, where[..., ::-1].transpose(2, 0, 1), order=1, mode="nearest")
    outside = np.median(profile[:, along > 2.0], axis=1)
    noise = 1.4826 * np.median(np.abs(profile[:, along > 2.0] - outside[:, None]))
    least = max(_RISE * span, _RISE_NOISE * noise)
    first, third = (_outermost(profile, outside + k * least, along) for k in (1.0, 3.0))
    shifts = np.linspace(-0.5 * _REACH, 0.5 * _REACH, 81)
    left = np.array([_left_over(profile, along - shift) for shift in shifts])
    best = left.argmin(axis=0)
    i, row = np.clip(best, 1, len(shifts) - 2), np.arange(len(points))
    before, here, after = left[i - 1, row], left[i, row], left[i + 1, row]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = 0.5 * (before - after) / (before - 2.0 * here + after)
    return np.where((first - third < 1.0) & (best == i), shifts[i] + part * (shifts[1] - shifts[0]), np.nan)


def _left_over(profile: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Sums of squares that a step and a square root leave of profiles (N, M), at distances outwards of the edge."""
    fine = np.linspace(-2.0 * _REACH, 2.0 * _REACH, 801)
    blur = np.exp(-0.5 * (fine / _BLUR) ** 2)
    shapes = [np.ones_like(off)]
    for shape in (fine < 0.0, np.sqrt(np.maximum(-fine, 0.0))):
        shapes.append(np.interp(off, fine, np.convolve(shape, blur / blur.sum(), mode="same")))
    axes = np.linalg.qr(np.stack(shapes, axis=-1))[0]
    values: np.ndarray = (profile**2).sum(axis=1) - ((profile @ axes) ** 2).sum(axis=1)
    return values


def _outermost(profile: np.ndarray, level: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Where profiles, shape (N, M), last fall through a level, shape (N,); NaN where they do not."""
    above = profile > level[:, None]
    last = above.shape[1] - 1 - np.argmax(above[:, ::-1], axis=1)
    good = above.any(axis=1) & (last < above.shape[1] - 1)
    i = np.minimum(last, above.shape[1] - 2)
    row = np.arange(len(profile))
    before, after = profile[row, i], profile[row, i + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = (before - level) / (before - after)
    return np.where(good, along[i] + part * (along[1] - along[0]), np.nan)


def _span(values: np.ndarray, part: np.ndarray) -> float:
    """Of a part, apart from its highlights, above what is around it."""
    return float(np.median(values[part]) - (np.median(values[~part]) if not part.all() else 0.0))


def _precise_circle(
    start: np.ndarray, part: np.ndarray, values: np.ndarray, picture: _Picture, camera: PixelCamera
) -> Circle | None:
    from scipy.optimize import least_squares

    span = _span(values, part)
    turn = np.linspace(0.0, 2.0 * np.pi, max(90, min(720, int(4.0 * start[2]))), endpoint=False)
    outward = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    points = start[:2] + start[2] * outward
    reach = np.array(values.shape[::-1]) - 1.0
    points, outward = (a[((points > _REACH) & (points < reach - _REACH)).all(-1)] for a in (points, outward))
    off = _crossings(values, points, outward, span)
    points = points + off[:, None] * outward
    good = np.isfinite(off) & (np.abs(off) < _tolerance(start[2]) + 1.0)
    if good.sum() < 12:
        return None
    points = picture.place(points[good])
    places = picture.place(start[:2])
    scale = picture.step
    if camera.focal is None:
        fit = least_squares(
            lambda c: _distance(c, points), [*places, start[2] * scale], loss="soft_l1", f_scale=0.2 * scale
        )
        x, y, r = (float(v) for v in fit.x)
    else:
        # the outline is a cone about the direction of the centre
        rays = camera.view(points[:, 0], points[:, 1])
        focal = camera.focal
        begin = camera.view(*np.array(places))

        def off_cone(c: np.ndarray) -> np.ndarray:
            axis = np.array([c[0], c[1], 1.0])
            axis /= np.linalg.norm(axis)
            angle = np.arctan2(np.linalg.norm(np.cross(rays, axis), axis=-1), rays @ axis)
            values: np.ndarray = focal * (angle - c[2])
            return values

        first = [*(begin[:2] / begin[2]), math.atan(start[2] * scale / focal)]
        fit = least_squares(off_cone, first, loss="soft_l1", f_scale=0.2 * scale, x_scale=[1 / focal] * 3)
        axis = np.array([fit.x[0], fit.x[1], 1.0])
        x, y = camera.place(axis / np.linalg.norm(axis))
        r = focal * math.tan(float(fit.x[2]))
    close = np.abs(fit.fun) < scale
    if close.sum() < 12:
        return None
    arc = _arc(np.array([x, y, r]), points[close])
    return Circle(x, y, r, arc, float(np.sqrt(np.mean(fit.fun[close] ** 2))))


def _sampled_lines(points: np.ndarray) -> list[np.ndarray] | None:
    """Two nearly parallel lines (nx, ny, c), n·point = c, that most outline points lie on; n points inwards."""
    rng = np.random.default_rng(0)
    lines: list[np.ndarray] = []
    rest = points
    for _ in range(2):
        if len(rest) < 12:
            return None
        pairs = rest[np.stack([rng.choice(len(rest), 2, replace=False) for _ in range(_TRIALS)])]
        along = pairs[:, 1] - pairs[:, 0]
        length = np.hypot(*along.T)
        normal = np.stack([-along[:, 1], along[:, 0]], axis=-1) / length[:, None]
        normal = normal[length > 5.0]
        through = pairs[length > 5.0, 0]
        if lines:
            parallel = np.abs(normal @ lines[0][:2]) > math.cos(math.radians(25.0))
            normal, through = normal[parallel], through[parallel]
        if not len(normal):
            return None
        level = (normal * through).sum(-1)
        votes = (np.abs(rest @ normal.T - level) < 1.2).sum(0)
        line = np.array([*normal[np.argmax(votes)], level[np.argmax(votes)]])
        for _ in range(3):
            close = np.abs(_inside(line, rest)) < 1.5
            if close.sum() < 6:
                return None
            line = _line(rest[close])
        lines.append(line)
        rest = rest[np.abs(_inside(line, rest)) > 3.0]
    first, second = lines
    near = [points[np.abs(_inside(line, points)) < 1.5].mean(axis=0) for line in lines]
    first *= np.sign(_inside(first, near[1]))
    second *= np.sign(_inside(second, near[0]))
    return [first, second]


def _inside(line: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How far points, shape (..., 2), lie on the side of a line that its normal points to."""
    values: np.ndarray = points @ line[:2] - line[2]
    return values


def _line(points: np.ndarray) -> np.ndarray:
    """Least squares of the distances: (nx, ny, c)."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][1]
    return np.array([*normal, normal @ middle])


def _precise_bar(
    lines: list[np.ndarray], points: np.ndarray, part: np.ndarray, values: np.ndarray, picture: _Picture
) -> Bar | None:
    edges, off_line = [], []
    for line in lines:
        on = points[np.abs(_inside(line, points)) < 1.5]
        inward, along = line[:2], np.array([-line[1], line[0]])
        # not where the edge ends
        low, high = np.percentile(on @ along, (3.0, 97.0))
        start = line[2] * inward + np.linspace(low, high, max(20, min(400, int(high - low))))[:, None] * along
        off = _crossings(values, start, np.broadcast_to(-inward, start.shape), _span(values, part))
        moved = (start - off[:, None] * inward)[np.abs(off) < 3.0]
        if len(moved) < 0.5 * len(start):
            return None
        fitted = _line(moved)
        distance = _inside(fitted, moved)
        moved = moved[np.abs(distance) < 3.0 * max(1.4826 * float(np.median(np.abs(distance))), 0.05)]
        fitted = _line(moved)
        off_line.append(_inside(fitted, moved))
        edges.append([end - _inside(fitted, end) * fitted[:2] for end in (start[0], start[-1])])
    residual = picture.step * math.sqrt(np.mean(np.concatenate(off_line) ** 2))
    return _bar(picture.place(np.array(edges)), picture.place(points), part.shape, picture, residual)


def _bar(
    edges: np.ndarray,
    points: np.ndarray,
    shape: tuple[int, int],
    picture: _Picture,
    residual: float,
) -> Bar:
    directions = edges[:, 1] - edges[:, 0]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    if directions[0] @ directions[1] < 0.0:
        directions[1] *= -1.0
    along = directions.sum(axis=0)
    along /= np.linalg.norm(along)
    if along[0] < -1e-9 or (abs(along[0]) <= 1e-9 and along[1] > 0.0):
        along = -along
    across = np.array([-along[1], along[0]])
    # where the middle line runs, and how wide the bar is in the middle of its length
    s = points @ along
    low, high = float(s.min()), float(s.max())
    middle = 0.5 * (low + high)
    crossing = []
    for (start, _), direction in zip(edges, directions, strict=True):
        t = (middle - start @ along) / (direction @ along)
        crossing.append((start + t * direction) @ across)
    centre = middle * along + 0.5 * sum(crossing) * across
    # ends at the border of the picture are no ends
    rows, columns = shape
    reach = [centre + (end - middle) * along for end in (low, high)]
    size = picture.place(np.array([columns - 1.0, rows - 1.0]))
    margin = 3.0 * picture.step + 1.0
    leaves = [not ((end > margin) & (end < size - margin)).all() for end in reach]
    half = 0.5 * abs(crossing[0] - crossing[1])
    return Bar(
        x=float(centre[0]),
        y=float(centre[1]),
        half_width=float(half),
        angle=min(math.atan2(-float(along[1]), float(along[0])), 0.5 * math.pi),
        length=None if all(leaves) else high - low,
        edges=edges,
        residual=residual,
    )
