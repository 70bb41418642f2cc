"""A figure drawn once, as pixels and as SVG: to lay out its axes, ticks and words takes longer than the lines do.

The SVG has the coordinates of the pixels: what matplotlib states in points, the size of letters, the width of lines and
their dashes, is brought to pixels here; all places come in pixels.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backend_bases import GraphicsContextBase
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import RendererSVG

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["drawn"]

_POINTS_PER_INCH = 72.0
#: Name of what only the pixels show, the white ground of figure and axes.
_GROUND = "ground"


def drawn(figure: Figure, dots_per_inch: float) -> tuple[np.ndarray, str]:
    """Draw a figure in the settings that are in force.

    Parameters
    ----------
    figure
        The figure.
    dots_per_inch
        Resolution of the pixels.

    Returns
    -------
    pixels
        RGBA, shape (height, width, 4), bytes.
    svg
        A document without ground whose unit is a pixel; artists that are rasterized are pictures in it.
    """
    across, down = (float(size) for size in figure.get_size_inches())
    width, height = dots_per_inch * across, dots_per_inch * down
    text = io.StringIO()
    svg = RendererSVG(width, height, text, image_dpi=int(_POINTS_PER_INCH), metadata={"Date": None})
    grounds = [figure.patch, *(ax.patch for ax in figure.axes)]
    names, usual = [ground.get_gid() for ground in grounds], figure.dpi
    figure.dpi = dots_per_inch
    try:
        for ground in grounds:
            ground.set_gid(_GROUND)
        both = _Both(
            width, height, dots_per_inch, MixedModeRenderer(figure, across, down, dots_per_inch, svg)
        )
        figure.draw(both)
        svg.finalize()
    finally:
        figure.dpi = usual
        for ground, name in zip(grounds, names, strict=True):
            ground.set_gid(name)
    return np.asarray(both.buffer_rgba()), text.getvalue()


class _Both(RendererAgg):
    """Draws pixels, and the same with another renderer, in the same coordinates."""

    def __init__(self, width: float, height: float, dpi: float, other: MixedModeRenderer) -> None:
        super().__init__(width, height, dpi)
        self._other = other
        self._muted = False
        self._point = dpi / _POINTS_PER_INCH
        # Agg's are attributes of the instance
        for name in ("draw_markers", "draw_image", "draw_quad_mesh", "draw_gouraud_triangles"):
            setattr(self, name, self._twice(getattr(self, name), name))
        self._pixels_of_collection = self.draw_path_collection
        self.draw_path_collection = self._draw_path_collection  # type: ignore[method-assign]

    def _twice(self, pixels: Any, name: str) -> Any:
        def draw(gc: GraphicsContextBase, *arguments: Any, **more: Any) -> None:
            pixels(gc, *arguments, **more)
            getattr(self._other, name)(self._in_pixels(gc), *arguments, **more)

        return draw

    def _in_pixels(self, gc: GraphicsContextBase) -> GraphicsContextBase:
        copy = self.new_gc()
        copy.copy_properties(gc)
        copy.set_linewidth(self._point * gc.get_linewidth())
        copy.set_dashes(*self._dashes(gc.get_dashes()))
        return copy

    def _dashes(self, pattern: tuple[float, Any]) -> tuple[float, list[float] | None]:
        offset, dashes = pattern
        return self._point * offset, None if dashes is None else [self._point * dash for dash in dashes]

    def draw_path(self, gc: GraphicsContextBase, path: Any, transform: Any, rgbFace: Any = None) -> None:
        super().draw_path(gc, path, transform, rgbFace)
        if not self._muted:
            self._other.draw_path(self._in_pixels(gc), path, transform, rgbFace)

    def _draw_path_collection(
        self,
        gc: GraphicsContextBase,
        master_transform: Any,
        paths: Any,
        all_transforms: Any,
        offsets: Any,
        offset_trans: Any,
        facecolors: Any,
        edgecolors: Any,
        linewidths: Any,
        linestyles: Any,
        *rest: Any,
        **more: Any,
    ) -> None:
        shape = (master_transform, paths, all_transforms, offsets, offset_trans, facecolors, edgecolors)
        self._pixels_of_collection(gc, *shape, linewidths, linestyles, *rest, **more)
        widths = [self._point * width for width in linewidths]
        dashes = [self._dashes(pattern) for pattern in linestyles]
        self._other.draw_path_collection(gc, *shape, widths, dashes, *rest, **more)

    def draw_text(
        self, gc: Any, x: Any, y: Any, s: Any, prop: Any, angle: Any, *rest: Any, **more: Any
    ) -> None:
        super().draw_text(gc, x, y, s, prop, angle, *rest, **more)
        larger = prop.copy()
        larger.set_size(self._point * prop.get_size_in_points())
        self._other.draw_text(gc, x, y, s, larger, angle, *rest, **more)

    def open_group(self, s: str, gid: str | None = None) -> None:
        self._muted = gid == _GROUND
        if not self._muted:
            self._other.open_group(s, gid)

    def close_group(self, s: str) -> None:
        if self._muted:
            self._muted = False
        else:
            self._other.close_group(s)

    def start_rasterizing(self) -> None:
        self._other.start_rasterizing()

    def stop_rasterizing(self) -> None:
        self._other.stop_rasterizing()
