"""From a coarse grid to every pixel: borders between materials, and wrong neighbours undone."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from map_helpers import assert_same, directions, measured, pixel, varied

import pbrdf
from pbrdf.inversion.clusters import cluster
from pbrdf.inversion.parameter_map import PixelStatus, search
from pbrdf.inversion.parameter_map.ends import Ends, Pixels, grouped
from pbrdf.inversion.parameter_map.lattice import levels, neighbours
from pbrdf.inversion.solver import Status

FIX = {"k": 1.2504, "b": 0.1827}


def places_of(mask):
    return np.stack(np.nonzero(mask), axis=1)


@pytest.mark.parametrize("shape", [(1, 1), (7,), (40, 33), (300, 2), (6, 9, 11)])
def test_every_pixel_is_in_one_level_and_has_fitted_parents(shape):
    mask = np.random.default_rng(0).random(shape) < 0.8
    mask.flat[0] = True
    places = places_of(mask)
    steps = levels(shape, places)
    assert np.sort(np.concatenate([s.pixels for s in steps])).tolist() == list(range(len(places)))
    assert 1 <= len(steps[0].pixels) <= 16
    fitted = np.zeros(len(places), dtype=bool)
    for step in steps:
        if step.parents.shape[1]:
            assert fitted[step.parents[step.parents >= 0]].all()
            assert (step.parents >= 0).any(axis=1).all()
            assert ((step.weights > 0.0) == (step.parents >= 0)).all()
        fitted[step.pixels] = True


def test_parents_interpolate_a_linear_map():
    shape = (64, 48)
    places = places_of(np.ones(shape, dtype=bool))
    value = places @ [2.0, -3.0]
    for step in levels(shape, places)[1:]:
        weights = step.weights / step.weights.sum(axis=1, keepdims=True)
        between = (weights * np.where(step.parents >= 0, value[step.parents], 0.0)).sum(axis=1)
        whole = (step.parents >= 0).all(axis=1)
        # representatives stand half a pixel beside the middle of a cell of even width
        assert np.abs(between - value[step.pixels])[whole].max() <= 2.5 + 1e-9


def test_neighbours_of_a_region_with_a_hole():
    mask = np.ones((3, 3), dtype=bool)
    mask[1, 1] = False
    beside = neighbours((3, 3), places_of(mask))
    assert beside[0].tolist() == [-1, 3, -1, 1]
    assert beside[3].tolist() == [0, 5, -1, -1]


def test_groups_of_ends_are_those_of_a_single_fit():
    random = np.random.default_rng(4)
    u = random.random((5, 40, 3)).round(1)
    cost = (1.0 + u.sum(axis=2)) * (1.0 + 1e-7 * random.random((5, 40)))
    cost[:, ::7] = np.inf
    span = np.array([1.0, 2.0, 0.5])
    found = grouped(u, cost, np.tile(span, (5, 1)), 0.15, 1e-3, 40)
    for own, ends, costs in zip(found, u, cost, strict=True):
        single = [members[0] for members in cluster(ends, costs, span, 0.15, 1e-3)]
        assert own[own >= 0].tolist() == single


def two_materials(shape):
    """A sharp border along a diagonal between two paints, and an island of one pixel."""
    values, rows = varied(shape), np.add.outer(np.arange(shape[0]), np.arange(shape[1]))
    other = rows > shape[0]
    other[2, 2] = True
    for name, value in {"sigma": 0.09, "n": 1.35, "a": 0.3, "t": 0.1}.items():
        values[name] = np.where(other, value, values[name])
    return values


@pytest.mark.slow
def test_a_sharp_border_between_two_materials():
    shape = (24, 20)
    values = two_materials(shape)
    data = measured(values, directions())
    found = pbrdf.fit_map(data, fix=FIX)
    assert (found["status"] == PixelStatus.CONVERGED).all()
    pull = [
        (found["estimate"].sel(parameter=n) - values[n]) / found["standard_error"].sel(parameter=n)
        for n in ("sigma", "n", "a", "t")
    ]
    assert np.nanmax(np.abs(pull)) < 5.0 and 0.9 < np.nanstd(pull) < 1.1
    reduced = found["chi2"] / found["degrees_of_freedom"]
    assert 0.9 < float(reduced.mean()) < 1.1 and float(reduced.max()) < 2.0
    for y, x in ((2, 2), (12, 12), (12, 13), (5, 19), (23, 1), (23, 2)):
        assert_same(found.isel(y=y, x=x), pbrdf.fit(pixel(data, y=y, x=x), fix=FIX))


@pytest.fixture
def fitted():
    """Pixels of a map with their ends, and what is needed to look for wrong ones."""
    data = measured(varied((20, 20)), directions())
    prepared = pbrdf.MapFit.prepare(data, fix=FIX, starts=16)
    part = prepared._part(data)
    pixels = prepared._pixels(part)
    known = part.stack.std_known
    ends = search.fit_pixels(pixels, part.shape, part.places, part.freedom, known)
    return pixels, ends, (part.shape, part.places, part.freedom, known)


def planted(pixels, ends, wrong):
    """The same ends, but for some that stand at the same wrong place."""
    result = Ends(**{f.name: getattr(ends, f.name).copy() for f in fields(Ends)})
    result.u[wrong] = 0.8 * pixels.low[wrong] + 0.2 * pixels.high[wrong]
    solution = pixels.search(np.flatnonzero(wrong), result.u[wrong])
    result.cost[wrong] = 3.0 * solution.cost
    result.status[wrong] = int(Status.SMALL_STEP)
    return result


def counted(monkeypatch):
    """How many pixels are searched from many starts from here on."""
    tried = []
    original = Pixels.from_many

    def from_many(self, numbers, *arguments, **named):
        tried.extend(numbers.tolist())
        return original(self, numbers, *arguments, **named)

    monkeypatch.setattr(Pixels, "from_many", from_many)
    return tried


@pytest.mark.slow
@pytest.mark.parametrize("region", ["pixel", "patch", "all"])
def test_wrong_neighbours_are_undone(fitted, monkeypatch, region):
    pixels, ends, about = fitted
    y, x = about[1].T
    wrong = {"pixel": (y == 7) & (x == 11), "patch": (y < 9) & (x > 8), "all": y >= 0}[region]
    tried = counted(monkeypatch)
    mended = planted(pixels, ends, wrong)
    assert (
        search.standing_out(mended.cost, about[2], about[3], *about[:2])[wrong] > search.TRIED_AGAIN
    ).all()
    search._undo_wrong_ones(pixels, mended, *about)
    error = np.sqrt(np.einsum("bpp->bp", np.linalg.inv(ends.information)))
    np.testing.assert_allclose(mended.u / error, ends.u / error, atol=1e-3)
    np.testing.assert_allclose(mended.cost, ends.cost, rtol=1e-6)
    # others than the planted ones stand out by chance; of all that went wrong a few were enough
    assert len(tried) <= search.AT_FIRST * (1 + search.MORE)
    if region != "all":
        assert not {*np.flatnonzero(wrong).tolist()} & {*tried}
    assert (mended.optima[wrong] >= 2).all()


@pytest.mark.slow
def test_the_optima_of_a_pixel_are_those_of_a_single_fit():
    data = measured(varied((2, 2)), directions(5), noise=0.05, channels="I")
    found = pbrdf.fit_map(data)
    counts = [[len(pbrdf.fit(pixel(data, y=y, x=x)).optima) for x in range(2)] for y in range(2)]
    assert np.max(counts) > 1
    assert (found["optima"].values > 1).tolist() == (np.array(counts) > 1).tolist()
    assert found.attrs["share_of_several_optima"] == np.mean(np.array(counts) > 1)


def test_what_stands_out():
    freedom = np.full(400, 100)
    cost = 0.5 * np.random.default_rng(1).chisquare(100, 400)
    places = places_of(np.ones((20, 20), dtype=bool))
    known = np.ones(400, dtype=bool)
    plain = search.standing_out(cost, freedom, known, (20, 20), places)
    assert (plain > search.TRIED_AGAIN).mean() < 0.01
    cost[33], cost[50] = 200.0, np.inf
    assert search.standing_out(cost, freedom, known, (20, 20), places)[[33, 50]].min() > search.TRIED_AGAIN
    # a model that fits no pixel makes none stand out, unless uncertainties say so
    bad = 50.0 * cost
    assert (search.standing_out(bad, freedom, ~known, (20, 20), places) > search.TRIED_AGAIN).sum() <= 4
    assert (search.standing_out(bad, freedom, known, (20, 20), places) > search.TRIED_AGAIN).all()
