"""A polarimeter before a rendered scene: frames of the picture, and data sets from what they are reduced to.

From paint to pixels and back: every pixel of a curved painted surface under one small lamp is a geometry of its own, so
one picture holds a measurement of its BRDF.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from pbrdf.errors import DataError
from pbrdf.instruments.frames.frames import ArrayFrames, Frames
from pbrdf.instruments.frames.mosaic import MosaicFrames
from pbrdf.instruments.goniometer.rays import angles_of
from pbrdf.instruments.pixel_geometry.geometry import MAX_ZENITH, plane_rotation
from pbrdf.instruments.polarimeter.instrument import Instrument
from pbrdf.instruments.reduction.stokes_image import StokesImage
from pbrdf.instruments.reduction.surface_axes import to_surface_axes
from pbrdf.rendering.cameras import camera_scenes, picture_size
from pbrdf.rendering.picture import StokesPicture
from pbrdf.rendering.render import central_rays

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PixelGeometry", "exposure_for", "picture_frames", "pixel_dataset", "pixel_geometry"]


@dataclass(frozen=True)
class PixelGeometry:
    """Where each pixel looks, shape (rows, columns) throughout; NaN and "" where it sees no lit surface.

    Attributes
    ----------
    theta_i, theta_r, phi
        Angles at the surface in the middle of the pixel, radians.
    plane_angle
        Angle of the surface's p direction, from the horizontal of the picture, counterclockwise, radians.
    distance
        From the surface to the lamp, metres.
    shape
        Name (Mitsuba's id) of the shape.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    phi: np.ndarray
    plane_angle: np.ndarray
    distance: np.ndarray
    shape: np.ndarray


def pixel_geometry(scene: Any, lamp: Sequence[float]) -> PixelGeometry:
    """Geometry of each pixel of a scene's first camera under a small lamp; of a batch side by side, as in its picture.

    Parameters
    ----------
    scene
        A Mitsuba scene in the active variant.
    lamp
        Position of the lamp, metres.
    """
    parts = [_camera_geometry(camera, lamp) for camera in camera_scenes(scene)]
    return PixelGeometry(
        *(np.concatenate([getattr(part, f.name) for part in parts], axis=1) for f in fields(PixelGeometry))
    )


def _camera_geometry(scene: Any, lamp: Sequence[float]) -> PixelGeometry:
    import drjit as dr
    import mitsuba as mi

    sensor = scene.sensors()[0]
    columns, rows = picture_size(scene)
    ray = central_rays(scene)
    si = scene.ray_intersect(ray)
    target = mi.Point3f([float(c) for c in lamp])
    lit = si.is_valid() & ~scene.ray_test(si.spawn_ray_to(target))
    # Mitsuba's camera looks along +z with x to the left
    axes = [sensor.world_transform() @ mi.Vector3f(*axis) for axis in ((-1, 0, 0), (0, 1, 0), (0, 0, -1))]
    dr.eval(ray, si, lit, axes)

    def column(vector: Any) -> np.ndarray:
        return np.broadcast_to(np.array(vector, dtype=float).T, (rows * columns, 3))

    seen, normal, point = column(-ray.d), column(si.sh_frame.n), column(si.p)
    to_lamp = np.asarray(lamp, dtype=float) - point
    distance = np.linalg.norm(to_lamp, axis=-1)
    to_lamp = to_lamp / distance[:, None]
    good = np.array(lit) & ((normal * seen).sum(-1) > 0.0) & ((normal * to_lamp).sum(-1) > 0.0)
    theta_i, theta_r, phi = angles_of(normal, to_lamp, seen)
    camera = np.stack([np.array(axis, dtype=float).ravel() for axis in axes], axis=-1)
    plane = plane_rotation(normal @ camera, seen @ camera, to_lamp @ camera)
    names = np.full(rows * columns, "", dtype=object)
    for shape in scene.shapes():
        names[np.array(si.shape == mi.ShapePtr(shape))] = shape.id()

    def picture(values: np.ndarray) -> np.ndarray:
        return np.where(good, values, np.nan).reshape(rows, columns)

    return PixelGeometry(
        theta_i=picture(theta_i),
        theta_r=picture(theta_r),
        phi=picture(phi),
        plane_angle=picture(plane),
        distance=picture(distance),
        shape=np.where(good, names, "").astype(str).reshape(rows, columns),
    )


def exposure_for(pictures: Sequence[StokesPicture], instrument: Instrument, share: float = 0.8) -> float:
    """Digital numbers per radiance with which the brightest pixel reaches a share of the detector's range.

    Raises
    ------
    DataError
        If the pictures are dark.
    """
    brightest = max(float(np.nanmax(_intensities(picture, instrument))) for picture in pictures)
    if not brightest > 0.0:
        raise DataError("the pictures are dark: there is nothing to expose for")
    return share * instrument.detector.range / brightest


def picture_frames(
    pictures: Mapping[str, StokesPicture], instrument: Instrument, exposure: float, seed: int = 0
) -> Frames:
    """Frames that an instrument takes of rendered pictures.

    Parameters
    ----------
    pictures
        Of the same size, by the name of the series.
    instrument
        Its polarimeter sees the pictures in their own axes: x to the right, y up. Of a division of focal plane each
        pixel of the picture is one of its pixels.
    exposure
        Digital numbers per radiance, see :func:`exposure_for`.
    seed
        Of the noise.

    Raises
    ------
    DataError
        If there is no picture or their sizes differ.
    """
    if len({picture.shape for picture in pictures.values()}) != 1:
        raise DataError("frames need at least one picture, and pictures of one size")
    rng = np.random.default_rng(seed)
    read = np.stack(
        [instrument.detector.expose(exposure * _intensities(p, instrument), rng) for p in pictures.values()]
    )
    frames = ArrayFrames(read, tuple(pictures))
    return frames if instrument.polarimeter.mosaic is None else MosaicFrames(frames, instrument.polarimeter)


def _intensities(picture: StokesPicture, instrument: Instrument) -> np.ndarray:
    """Noiseless intensities of the states, shape (N, rows, columns); (1, rows, columns) of a mosaic."""
    values = instrument.polarimeter.intensities(picture.stokes)
    mosaic = instrument.polarimeter.mosaic
    if mosaic is None:
        return values
    rows, columns = picture.shape
    state = np.tile(mosaic, (-(-rows // mosaic.shape[0]), -(-columns // mosaic.shape[1])))[:rows, :columns]
    return np.take_along_axis(values, state[None], axis=0)


def pixel_dataset(
    image: StokesImage,
    geometry: PixelGeometry,
    *,
    exposure: float,
    intensity: float,
    shape: str | None = None,
    max_zenith: float = MAX_ZENITH,
    every: int = 1,
    attrs: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """BRDF of a painted surface, pixel by pixel, from a reduced picture.

    Parameters
    ----------
    image
        Reduced frames, see :func:`pbrdf.instruments.reduction.stokes_image.reduce_frames`; in the axes of the picture.
    geometry
        Of the same pixels.
    exposure
        Digital numbers per radiance.
    intensity
        Radiant intensity of the lamp: its irradiance at the distance d is intensity/d².
    shape
        Name of the shape to look at; all by default.
    max_zenith
        Pixels with a larger zenith angle of lamp or camera are left out: at the rim a pixel sees too much of the
        surface.
    every
        Take every so manieth pixel.
    attrs
        See :func:`pbrdf.data.make_dataset`.

    Returns
    -------
    xarray.Dataset
        Quantity ``brdf``, Stokes components that were determined, with their covariance, in the axes (p, s).

    Raises
    ------
    DataError
        If the sizes differ or no pixel is left.
    """
    from pbrdf.data.build import make_dataset
    from pbrdf.optics.stokes import STOKES

    if image.flags.shape != geometry.theta_i.shape:
        raise DataError(f"the frames have {image.flags.shape} pixels, the geometry {geometry.theta_i.shape}")
    used = (image.flags == 0) & (geometry.theta_i < max_zenith) & (geometry.theta_r < max_zenith)
    if shape is not None:
        used &= geometry.shape == shape
    where = np.flatnonzero(used)[::every]
    if not where.size:
        raise DataError("no pixel sees the surface well lit and well exposed")

    def pick(values: np.ndarray) -> np.ndarray:
        return values.ravel()[where]

    theta_i = pick(geometry.theta_i)
    scale = exposure * intensity * np.cos(theta_i) / pick(geometry.distance) ** 2
    stokes, covariance = to_surface_axes(
        image.stokes.reshape(4, -1)[:, where].T / scale[:, None],
        image.covariance.reshape(4, 4, -1)[:, :, where].transpose(2, 0, 1) / scale[:, None, None] ** 2,
        # from p to the horizontal of the picture, the other way round
        -pick(geometry.plane_angle),
    )
    measured: dict[str, Any] = {
        name: stokes[:, k] for k, name in enumerate(STOKES) if np.isfinite(stokes[:, k]).all()
    }
    return make_dataset(
        theta_i,
        pick(geometry.theta_r),
        pick(geometry.phi),
        quantity="brdf",
        **measured,
        covariance=covariance,
        simulated=True,
        attrs={"source": "a rendered picture, seen by a virtual polarimeter", **(attrs or {})},
    )
