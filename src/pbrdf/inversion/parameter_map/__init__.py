"""Maps of parameters: a fit at every pixel of an image, or along any dimensions beside the geometries."""

from pbrdf.inversion.parameter_map.fit_map import fit_map
from pbrdf.inversion.parameter_map.layout import FLAGS, PENDING, PixelStatus
from pbrdf.inversion.parameter_map.map_fit import MapFit

__all__ = ["FLAGS", "PENDING", "MapFit", "PixelStatus", "fit_map"]
