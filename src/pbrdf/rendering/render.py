"""Rendering a scene in passes: Stokes vectors with their standard errors, in this project's convention."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pbrdf.errors import PbrdfError
from pbrdf.rendering.cameras import camera_scenes, groups_of_shapes, parts_of, picture_size
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
    """Render the first camera of a scene by path tracing; the cameras of a ``batch`` side by side, each in its axes.

    The samples are taken in passes with different seeds; the spread of the passes gives the standard error of each
    pixel.

    Parameters
    ----------
    scene
        A Mitsuba scene in the active, polarised variant.
    spp
        Samples per pixel.
    depth
        Longest path: 1 sees lights alone, 2 light that was reflected once; −1 sets no limit. Sheets that light passes
        straight, such as Mitsuba's ``polarizer`` and ``retarder``, do not count.
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
        If the numbers are out of range, the scene's first sensor is no camera, or Mitsuba cannot render the scene.
    """
    if spp < 1 or depth < -1 or depth == 0 or seed < 0:
        raise PbrdfError(
            f"spp is {spp}, depth {depth}, seed {seed}: use 1 or more, 1 or more (or -1), 0 or more"
        )
    cameras = camera_scenes(scene)
    columns, rows = picture_size(scene)
    if rows * columns > _MOST_PIXELS:
        raise PbrdfError(f"{columns} × {rows} pixels are more than the {_MOST_PIXELS} allowed")
    pictures = []
    for i, camera in enumerate(cameras):

        def of_all(done: int, passes: int, i: int = i) -> None:
            if progress is not None and (done or not i):
                progress(i * passes + done, len(cameras) * passes)

        pictures.append(_render_camera(camera, spp, depth, seed * len(cameras) + i, of_all))
    stokes, std, surface = (np.concatenate(parts, axis=-1) for parts in zip(*pictures, strict=True))
    attrs = {"spp": float(spp), "depth": float(depth), "seed": float(seed)}
    return StokesPicture(stokes, std, attrs, surface=surface)


def _render_camera(
    scene: Any, spp: int, depth: int, seed: int, progress: Callable[[int, int], None]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stokes vectors, their standard errors and which pixels show a surface."""
    import mitsuba as mi

    columns, rows = picture_size(scene)
    # `path` takes a sheet that light passes straight, a polariser for instance, for opaque when it looks for lamps
    nested = "volpath" if _has_sheets(scene) else "path"
    integrator = mi.load_dict({"type": "stokes", "nested": {"type": nested, "max_depth": depth}})
    spp = max(spp, -(-_FEWEST_SAMPLES // (rows * columns)))
    sizes = _pass_sizes(spp, rows * columns)
    mean = np.zeros((4, rows, columns))
    squares = np.zeros_like(mean)
    taken = 0
    for i, size in enumerate(sizes):
        progress(i, len(sizes))
        stokes = _one_pass(scene, integrator, size, seed * len(sizes) + i)
        # Welford's update, weighted with the samples of the pass
        taken += size
        change = stokes - mean
        mean += change * (size / taken)
        squares += size * change * (stokes - mean)
    progress(len(sizes), len(sizes))
    std = np.full_like(mean, np.nan)
    if len(sizes) > 1:
        std = np.sqrt(squares / (len(sizes) - 1) / taken)
    return mean, std, np.array(scene.ray_test(central_rays(scene))).reshape(rows, columns)


def _has_sheets(scene: Any) -> bool:
    """Whether light passes a surface of the scene straight: a polariser, a retarder, a mask, a thin pane."""
    import mitsuba as mi

    in_groups = [shape for group in groups_of_shapes(scene) for shape in parts_of(group, mi.Shape)]
    return any(
        shape.bsdf() is not None and mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null)
        for shape in (*scene.shapes(), *in_groups)
    )


def central_rays(scene: Any) -> Any:
    """The rays of the first camera of a scene through the middles of its pixels, row by row."""
    import drjit as dr
    import mitsuba as mi

    columns, rows = picture_size(scene)
    index = dr.arange(mi.UInt32, rows * columns)
    centre = mi.Point2f(
        (mi.Float(index % columns) + 0.5) / columns,
        (mi.Float(index // columns) + 0.5) / rows,
    )
    return scene.sensors()[0].sample_ray(0.0, 0.5, centre, mi.Point2f(0.5))[0]


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
