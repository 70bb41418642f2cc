"""Rendering a scene in passes: Stokes vectors with their standard errors, in this project's convention."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pbrdf.errors import PbrdfError
from pbrdf.rendering.picture import StokesPicture

__all__ = ["central_rays", "render_stokes"]

#: Samples of one pass, which bounds the memory, and passes that suffice for standard errors.
_PASS_SAMPLES = 1 << 22
_PASSES = 16
#: Dr.Jit cannot loop over a single sample: its state variables turn into constants.
_FEWEST_SAMPLES = 4
#: About 7 GB for the picture, its errors and what Mitsuba holds; more is a slip of the pen.
_MOST_PIXELS = 1 << 24
#: Weights of the linear sRGB primaries in the luminance, for spectral variants.
_LUMINANCE = {"R": 0.212671, "G": 0.715160, "B": 0.072169}


def render_stokes(
    scene: Any,
    *,
    spp: int = 256,
    depth: int = 8,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> StokesPicture:
    """Render the first camera of a scene by path tracing.

    The samples are taken in passes with different seeds; the spread of the passes gives the standard error of each
    pixel.

    Parameters
    ----------
    scene
        A Mitsuba scene in the active, polarised variant.
    spp
        Samples per pixel.
    depth
        Longest path: 1 sees lights alone, 2 light that was reflected once; −1 sets no limit.
    seed
        Another one gives another, independent picture.
    progress
        Called with the number of finished passes and of all.

    Returns
    -------
    StokesPicture
        Radiances; of a spectral variant the luminance.

    Raises
    ------
    PbrdfError
        If the numbers are out of range, or Mitsuba cannot render the scene.
    """
    import mitsuba as mi

    if spp < 1 or depth < -1 or depth == 0 or seed < 0:
        raise PbrdfError(
            f"spp is {spp}, depth {depth}, seed {seed}: use 1 or more, 1 or more (or -1), 0 or more"
        )
    columns, rows = (int(n) for n in scene.sensors()[0].film().crop_size())
    if rows * columns > _MOST_PIXELS:
        raise PbrdfError(f"{columns} × {rows} pixels are more than the {_MOST_PIXELS} allowed")
    integrator = mi.load_dict({"type": "stokes", "nested": {"type": "path", "max_depth": depth}})
    spp = max(spp, -(-_FEWEST_SAMPLES // (rows * columns)))
    sizes = _pass_sizes(spp, rows * columns)
    mean = np.zeros((4, rows, columns))
    squares = np.zeros_like(mean)
    taken = 0
    for i, size in enumerate(sizes):
        if progress is not None:
            progress(i, len(sizes))
        stokes = _one_pass(scene, integrator, size, seed * len(sizes) + i)
        # Welford's update, weighted with the samples of the pass
        taken += size
        change = stokes - mean
        mean += change * (size / taken)
        squares += size * change * (stokes - mean)
    if progress is not None:
        progress(len(sizes), len(sizes))
    std = np.full_like(mean, np.nan)
    if len(sizes) > 1:
        std = np.sqrt(squares / (len(sizes) - 1) / taken)
    surface = np.array(scene.ray_test(central_rays(scene))).reshape(rows, columns)
    return StokesPicture(
        mean, std, {"spp": float(spp), "depth": float(depth), "seed": float(seed)}, surface=surface
    )


def central_rays(scene: Any) -> Any:
    """The rays of the first camera of a scene through the middles of its pixels, row by row."""
    import drjit as dr
    import mitsuba as mi

    sensor = scene.sensors()[0]
    columns, rows = (int(n) for n in sensor.film().crop_size())
    index = dr.arange(mi.UInt32, rows * columns)
    centre = mi.Point2f(
        (mi.Float(index % columns) + 0.5) / columns,
        (mi.Float(index // columns) + 0.5) / rows,
    )
    return sensor.sample_ray(0.0, 0.5, centre, mi.Point2f(0.5))[0]


def _pass_sizes(spp: int, pixels: int) -> list[int]:
    """Samples per pixel of each pass: equal ones, but for the last."""
    fewest = -(-_FEWEST_SAMPLES // pixels)
    size = max(fewest, min(_PASS_SAMPLES // pixels, -(-spp // _PASSES)))
    sizes = [size] * (spp // size)
    rest = spp - sum(sizes)
    if 0 < rest < fewest:
        sizes[-1] += rest
    elif rest:
        sizes.append(rest)
    return sizes


def _one_pass(scene: Any, integrator: Any, spp: int, seed: int) -> np.ndarray:
    """Stokes vectors in this project's convention, shape (4, rows, columns)."""
    import mitsuba as mi

    try:
        image = np.asarray(mi.render(scene, integrator=integrator, spp=spp, seed=seed))
    except RuntimeError as error:
        reason = " ".join(str(error.__cause__ or error).split())
        raise PbrdfError(f"Mitsuba cannot render this scene: {reason}") from error
    names = integrator.aov_names()
    first = image.shape[-1] - len(names)
    # a single wavelength stands in all three colours alike
    weights = {"R": 1.0} if mi.is_monochromatic else _LUMINANCE
    stokes = np.zeros((4, *image.shape[:2]))
    for i in range(4):
        for colour, weight in weights.items():
            stokes[i] += weight * image[..., first + names.index(f"S{i}.{colour}")]
    # Mitsuba's axes are those of the picture, but its V counts right circular light positive
    stokes[3] *= -1.0
    return stokes
