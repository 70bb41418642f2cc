"""Meshes made by formulas: a piece of a car's body, and hills for its horizon. Lengths in metres, z up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["WHEEL_CENTRE", "WHEEL_RADIUS", "Mesh", "body_panel", "hills"]


@dataclass(frozen=True)
class Mesh:
    """Triangles with a normal at every vertex.

    Attributes
    ----------
    vertices, normals
        Shape (V, 3); the normals have unit length and point outwards.
    faces
        Vertex numbers, shape (F, 3), counterclockwise seen from outside.
    """

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray

    def split_along_x(self, count: int, first: float, last: float) -> list[Mesh]:
        """Cut the mesh, at the edges of triangles, into pieces of equal length between `first` and `last`.

        What lies before `first` or behind `last` goes with the first or the last piece.
        """
        middle = self.vertices[self.faces, 0].mean(axis=1)
        cuts = np.linspace(first, last, count + 1)[1:-1]
        piece = np.searchsorted(cuts, middle)
        return [self._with_faces(self.faces[piece == i]) for i in range(count)]

    def _with_faces(self, faces: np.ndarray) -> Mesh:
        used, numbers = np.unique(faces, return_inverse=True)
        return Mesh(self.vertices[used], self.normals[used], numbers.reshape(faces.shape))

    def to_mitsuba(self, name: str, bsdf: Any) -> Any:
        """The mesh as a Mitsuba shape that wears `bsdf`, an object of Mitsuba's."""
        import mitsuba as mi

        props = mi.Properties()
        props["bsdf"] = bsdf
        mesh = mi.Mesh(
            name,
            len(self.vertices),
            len(self.faces),
            props=props,
            has_vertex_normals=True,
            has_vertex_texcoords=False,
        )
        params = mi.traverse(mesh)
        params["vertex_positions"] = mi.Float(self.vertices.ravel().astype(np.float32))
        params["vertex_normals"] = mi.Float(self.normals.ravel().astype(np.float32))
        params["faces"] = mi.UInt32(self.faces.ravel().astype(np.uint32))
        params.update()
        return mesh


def _grid_mesh(points: np.ndarray, keep: np.ndarray | None = None) -> Mesh:
    """Mesh of a grid of points, shape (rows, columns, 3); the normal is ∂columns × ∂rows."""
    across = np.gradient(points, axis=1)
    up = np.gradient(points, axis=0)
    normals = np.cross(across, up)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (index[i : rows - 1 + i, j : columns - 1 + j] for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    cells = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=-2)
    if keep is not None:
        cells = cells[keep]
    return Mesh(points.reshape(-1, 3), normals.reshape(-1, 3), cells.reshape(-1, 3))


#: Front wheel of the body panel: x and z of its centre, and the radius of the tyre.
WHEEL_CENTRE = (-0.45, 0.32)
WHEEL_RADIUS = 0.315
_ARCH = 0.365
#: The gap between fender and door runs at this x, the one between fender and bonnet at this length along the section.
_DOOR_GAP, _BONNET_GAP = 0.42, 0.83
_GAP_HALF_WIDTH, _GAP_DEPTH = 0.0035, 0.016


def body_panel(columns: int = 900, rows: int = 700) -> Mesh:
    """A fender, a piece of the door and the bonnet: bulges, sharp body lines, panel gaps, an open wheel arch.

    The section is drawn by the angle of its tangent: where the angle turns fast the panel has an edge, and the
    reflections bend there without a jump of the surface. The side faces −y; x runs from the nose (−2) to the door (+2).

    Parameters
    ----------
    columns, rows
        Points along the car and along the section, from the sill over the shoulder to the middle of the bonnet.
    """
    x = _refined(-2.0, 2.0, columns, [_DOOR_GAP])
    s = _refined(0.0, 1.75, rows, [_BONNET_GAP])
    X, S = np.meshgrid(x, s)
    angle = _tangent_angle(X, S)
    step = np.diff(s)[:, None]
    middle = 0.5 * (angle[1:] + angle[:-1])
    start = np.zeros((1, columns))
    out = np.concatenate([start, np.cumsum(np.cos(middle) * step, axis=0)])
    z = 0.2 + np.concatenate([start, np.cumsum(np.sin(middle) * step, axis=0)])
    # towards the nose the car gets narrower and lower
    nose = np.maximum(-X - 0.3, 0.0) / 1.7
    out -= 0.26 * nose**2.4 + 0.012 * X**2
    z -= 0.16 * nose**2 * _step(S, 0.75, 0.6) * (z - 0.2)
    on_side = 1.0 - _step(S, 0.66, 0.12)
    rho = np.hypot(X - WHEEL_CENTRE[0], z - WHEEL_CENTRE[1])
    out += 0.045 * np.exp(-(((rho - _ARCH) / 0.085) ** 2)) * on_side
    # the rim of the arch turns in
    out -= 0.02 * np.exp(-((np.maximum(rho - _ARCH, 0.0) / 0.006) ** 2)) * on_side
    door = np.exp(-(((X - _DOOR_GAP) / _GAP_HALF_WIDTH) ** 2)) * (1.0 - _step(S, _BONNET_GAP - 0.02, 0.01))
    bonnet = np.exp(-(((S - _BONNET_GAP) / _GAP_HALF_WIDTH) ** 2)) * (1.0 - _step(X, _DOOR_GAP, 0.01))
    depth = -_GAP_DEPTH * np.maximum(door, bonnet)
    out += depth * np.sin(angle)
    z += depth * -np.cos(angle)
    points = np.stack([X, -out, z], axis=-1)
    inside = rho < _ARCH
    keep = ~(inside[:-1, :-1] & inside[1:, 1:] & inside[1:, :-1] & inside[:-1, 1:])
    return _grid_mesh(points, keep)


def _tangent_angle(x: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Angle of the section's tangent, radians: 90° where the side is upright, near 180° on the bonnet."""
    shoulder = 0.575 + 0.022 * x
    crease = 0.27 + 0.03 * x
    degrees = 80.0 + 18.0 * s / 0.6
    # lower line: the door turns in below it
    degrees = degrees - 16.0 * _step(s, crease - 0.06, 0.09) + 16.0 * _step(s, crease + 0.012, 0.016)
    # shoulder line: a sharp edge with a hollow above it
    degrees = degrees + 26.0 * _step(s, shoulder, 0.014) - 22.0 * _step(s, shoulder + 0.075, 0.12)
    # over the shoulder onto the bonnet
    degrees = degrees + 70.0 * _step(s, 0.73, 0.17)
    # a rise in the middle of the bonnet
    degrees = degrees - 13.0 * _step(s, 1.2, 0.03) + 13.0 * _step(s, 1.28, 0.07)
    flat = np.minimum(degrees, 178.0 - 2.0 * np.exp(-np.maximum(s - 0.9, 0.0)))
    return np.deg2rad(flat)


def _step(x: np.ndarray, centre: Any, width: float) -> np.ndarray:
    """From 0 to 1 about `centre`, over about `width`."""
    values: np.ndarray = 0.5 + 0.5 * np.tanh((x - centre) * (2.0 / width))
    return values


def _refined(first: float, last: float, count: int, places: list[float]) -> np.ndarray:
    """Increasing numbers, ten times denser about some places."""
    fine = np.linspace(first, last, 20_001)
    density = 1.0 + np.sum([9.0 * np.exp(-(((fine - p) / 0.02) ** 2)) for p in places], axis=0)
    cumulative = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return np.interp(np.linspace(0.0, cumulative[-1], count), cumulative, fine)


def hills(radius: float = 60.0, columns: int = 720, rows: int = 12) -> Mesh:
    """A ring of low hills around the scene; seen from inside."""
    azimuth = np.linspace(0.0, 2.0 * math.pi, columns)
    waves = ((2, 0.3, 1.0), (3, 1.1, 0.8), (5, 2.0, 0.7), (9, 0.5, 0.45), (17, 2.6, 0.25), (31, 4.0, 0.16))
    height = np.sum([a * np.sin(n * azimuth + phase) for n, phase, a in waves], axis=0)
    height = radius * (0.075 + 0.014 * height)
    up = np.linspace(0.0, 1.0, rows)[:, None]
    r = radius * (1.0 + 0.4 * up)
    points = np.stack(
        [r * np.cos(-azimuth), r * np.sin(-azimuth), np.sin(0.5 * math.pi * up) * height], axis=-1
    )
    return _grid_mesh(points)
