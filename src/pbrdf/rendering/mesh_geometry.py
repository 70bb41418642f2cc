"""A sample of any shape as a mesh before a camera: what each pixel sees of it, by casting rays with Mitsuba.

Places are those of the mesh's file; the camera's axes are those of :mod:`pbrdf.instruments.pixel_geometry.camera`.
Mitsuba casts rays in single precision: angles are good to about 1e-6, more where triangles are far from its origin.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pbrdf.errors import DataError
from pbrdf.instruments.pixel_geometry.camera import Lamp
from pbrdf.instruments.pixel_geometry.geometry import CurvedSample, LitSurface, Surface
from pbrdf.rendering.mitsuba_import import import_mitsuba
from pbrdf.rendering.variant import start_mitsuba

__all__ = ["MeshGeometry"]

_FORMATS = (".ply", ".obj")
#: Rays of one call of Mitsuba.
_RAYS = 2**20
_PARALLEL = 1e-6


@dataclass(frozen=True, kw_only=True)
class MeshGeometry(CurvedSample):
    """A mesh before a camera.

    The lamps' directions are seen from the middle of the mesh's bounding box, in the camera's axes, and their distances
    are in the unit of the mesh. Where the mesh shades itself it is not lit.

    Attributes
    ----------
    mesh
        Path of a PLY or OBJ file.
    origin, target
        Where the camera stands and what is in the middle of its picture.
    up
        Which direction is upwards in the picture.
    smooth
        Whether the normals at the vertices are used, which the file has or the neighbouring triangles give; else those
        of the triangles.
    pixel
        Size of a pixel on the mesh, before an orthographic camera.
    """

    mesh: str | Path = field()
    origin: tuple[float, float, float]
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    smooth: bool = True
    pixel: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        ahead = np.subtract(self.target, self.origin)
        if not np.linalg.norm(np.cross(ahead, self.up)) > _PARALLEL * np.linalg.norm(ahead) * np.linalg.norm(
            self.up
        ):
            raise DataError("the camera's place, its target and the direction upwards lie on one line")
        orthographic = self.camera.focal is None and self.camera.field_of_view is None
        if orthographic != (self.pixel is not None):
            raise DataError(
                "a mesh is seen with a field of view (fov) or focal length, or by an orthographic camera with the "
                "size of a pixel (pixel)"
            )
        if self.pixel is not None and not 0.0 < self.pixel < math.inf:
            raise DataError(f"the size of a pixel is {self.pixel:g}: it must be more than 0")

    def located(self, stokes: xr.Dataset) -> MeshGeometry:
        path = Path(self.mesh)
        if path.suffix.lower() not in _FORMATS:
            raise DataError(f"{path}: meshes are read from {', '.join(_FORMATS)}")
        if not path.is_file():
            raise DataError(f"{path}: there is no such file")
        return replace(self, camera=self._sized(stokes))

    def described(self) -> dict[str, Any]:
        about: dict[str, Any] = {"kind": "mesh", "file": Path(self.mesh).name}
        return {**about, **{name: list(getattr(self, name)) for name in ("origin", "target", "up")}}

    def _scene(self) -> Any:
        mi = import_mitsuba()
        if mi.variant() is None:
            start_mitsuba()
        return _scene(str(self.mesh), self.smooth, mi.variant())

    @property
    def _axes(self) -> np.ndarray:
        """The camera's x, y and z in the mesh's coordinates, shape (3, 3), one a row."""
        z = np.subtract(self.origin, self.target).astype(float)
        z /= np.linalg.norm(z)
        x = np.cross(self.up, z)
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])

    def surface(self, x: np.ndarray, y: np.ndarray) -> Surface:
        scene = self._scene()
        axes = self._axes
        shape = np.broadcast(x, y).shape
        view = self.camera.view(x, y)
        direction = np.broadcast_to(-view @ axes, (*shape, 3)).reshape(-1, 3)
        if self.pixel is None:
            start = np.broadcast_to(np.asarray(self.origin, float), direction.shape)
        else:
            start = (self.pixel * self.camera.plane(x, y).reshape(-1, 2)) @ axes[:2] + self.origin
        hit, point, normal = _cast(scene, start, direction)
        # of a surface without an inside, that side is seen which faces the camera
        toward = -(normal * direction).sum(-1) >= 0.0
        normal = np.where(toward[:, None], normal, -normal) @ axes.T
        return Surface(
            normal.reshape(*shape, 3),
            view,
            ((point - _middle(scene)) @ axes.T).reshape(*shape, 3),
            hit.reshape(shape),
        )

    def _lit(self, surface: Surface) -> Iterator[LitSurface]:
        scene, axes = self._scene(), self._axes
        middle = _middle(scene)
        for lamp in self.lamps:
            light, _ = lamp.seen_from(surface.point)
            facing = (light * surface.normal).sum(-1) > 0.0
            seen = surface.seen & facing
            seen[seen] &= ~_shaded(scene, surface, seen, lamp, light, axes, middle)
            yield LitSurface(surface._replace(seen=seen), lamp)


def _shaded(
    scene: Any,
    surface: Surface,
    where: np.ndarray,
    lamp: Lamp,
    light: np.ndarray,
    axes: np.ndarray,
    middle: np.ndarray,
) -> np.ndarray:
    """Whether the mesh stands between the lamp, whose direction is `light`, and its own points."""
    direction = np.broadcast_to(light, surface.point.shape)[where] @ axes
    extent = _extent(scene)
    # away from the surface by what single precision leaves open
    start = (surface.point[where] + 1e-4 * extent * surface.normal[where]) @ axes + middle
    far = np.full(len(start), 4.0 * extent)
    if math.isfinite(lamp.distance):
        far = np.linalg.norm(lamp.distance * lamp.direction - surface.point[where], axis=-1)
    return _cast(scene, start, direction, far)[0]


@functools.lru_cache(maxsize=4)
def _scene(path: str, smooth: bool, variant: str) -> Any:
    """The mesh as a Mitsuba scene, in the variant, which is the active one."""
    import mitsuba as mi

    kind = Path(path).suffix.lower().removeprefix(".")
    try:
        return mi.load_dict(
            {"type": "scene", "mesh": {"type": kind, "filename": path, "face_normals": not smooth}}
        )
    except RuntimeError as error:
        raise DataError(f"{path}: Mitsuba cannot read this mesh: {' '.join(str(error).split())}") from error


def _middle(scene: Any) -> np.ndarray:
    box = scene.bbox()
    values: np.ndarray = 0.5 * (
        np.array(box.min, dtype=float).ravel() + np.array(box.max, dtype=float).ravel()
    )
    return values


def _extent(scene: Any) -> float:
    box = scene.bbox()
    return float(np.linalg.norm(np.subtract(box.max, box.min)))


def _cast(
    scene: Any, start: np.ndarray, direction: np.ndarray, far: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether rays meet the mesh, shape (N,), where, and the normals there, shape (N, 3)."""
    import drjit as dr
    import mitsuba as mi

    if not len(start):
        return np.zeros(0, dtype=bool), np.zeros((0, 3)), np.zeros((0, 3))
    hits, points, normals = [], [], []
    for first in range(0, len(start), _RAYS):
        part = slice(first, first + _RAYS)
        ray = mi.Ray3f(
            mi.Point3f(*(mi.Float(np.ascontiguousarray(c, np.float32)) for c in start[part].T)),
            mi.Vector3f(*(mi.Float(np.ascontiguousarray(c, np.float32)) for c in direction[part].T)),
        )
        if far is not None:
            ray.maxt = mi.Float(far[part].astype(np.float32))
        si = scene.ray_intersect(ray)
        valid, point, normal = si.is_valid(), si.p, si.sh_frame.n
        dr.eval(valid, point, normal)
        hits.append(np.array(valid))
        points.append(np.array(point, dtype=float).T)
        normals.append(np.array(normal, dtype=float).T)
    normal = np.concatenate(normals)
    hit = np.concatenate(hits)
    # a ray that misses has no normal: any unit vector
    normal = np.where(hit[:, None], normal, [0.0, 0.0, 1.0])
    return hit, np.concatenate(points), normal / np.linalg.norm(normal, axis=-1, keepdims=True)
