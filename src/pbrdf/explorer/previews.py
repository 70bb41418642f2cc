"""Small pictures of the bundled paints for the empty page: outlines in the plane of incidence, as radii."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from pbrdf.data.paints import PAINTS, load_paint
from pbrdf.explorer.session import Emit
from pbrdf.explorer.workspace import Workspace
from pbrdf.optics.stokes import dolp

__all__ = ["THETA_I", "VIEWS", "answer", "outlines"]

#: Angle of incidence and viewing angles in the plane of incidence, degrees; negative on the source's side.
THETA_I = 45.0
VIEWS = np.linspace(-88.0, 88.0, 177)
#: Decades below the brightest direction of all paints that stand for a radius of 0.
_DECADES = 6.0


@cache
def outlines() -> list[dict[str, list[float]]]:
    """``intensity``, logarithmic, and ``dolp`` of each paint as shares of the largest of all, 0 … 1."""
    angles = np.deg2rad(THETA_I), np.deg2rad(np.abs(VIEWS)), np.where(VIEWS < 0.0, np.pi, 0.0)
    stokes = np.stack([load_paint(name).with_accuracy("fast").stokes(*angles) for name in PAINTS])
    decades = np.log10(np.maximum(stokes[..., 0], 1e-30))
    intensity = np.clip(1.0 + (decades - decades.max()) / _DECADES, 0.0, 1.0)
    polarised = dolp(stokes)
    return [
        {"intensity": np.round(i, 4).tolist(), "dolp": np.round(p, 4).tolist()}
        for i, p in zip(intensity, polarised / polarised.max(), strict=True)
    ]


def answer(request: Mapping[str, Any], buffers: Sequence[Any], workspace: Workspace, emit: Emit) -> None:
    """Answer with the outlines in the order of the catalogue's paints, and the viewing angles."""
    content = {"theta_i": THETA_I, "views": VIEWS.tolist(), "outlines": outlines()}
    emit({"type": "previews", "id": request.get("id"), **content}, [])
