"""Fields over the hemisphere of viewing directions, half of it where mirror symmetry gives the other half."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrdf.explorer.state import State
from pbrdf.explorer.workspace import Workspace

__all__ = ["draw"]

#: Zenith angles 0 … 90° and azimuths 0 … 180° of the grid.
ZENITHS, AZIMUTHS = 181, 181


def draw(state: State, workspace: Workspace, dragging: bool) -> tuple[dict[str, Any], list[bytes]]:
    """log10 I, Q/I, U/I and V/I of the active model in natural light, shape (ZENITHS, AZIMUTHS, 4), float16."""
    theta_r = np.deg2rad(np.linspace(0.0, 90.0, ZENITHS))[:, None]
    phi = np.deg2rad(np.linspace(0.0, 180.0, AZIMUTHS))
    model = state.shown.model.with_accuracy("fast" if dragging else "default")
    S = model.stokes(np.deg2rad(state.light.theta_i), theta_r, phi, part=state.part)
    intensity = np.maximum(S[..., :1], 1e-7)
    field = np.concatenate([np.log10(intensity), S[..., 1:] / intensity], axis=-1)
    header = {
        "shape": [ZENITHS, AZIMUTHS, 4],
        "channels": ["log_intensity", "q", "u", "v"],
        "mirror": [1, 1, -1, -1],
    }
    return header, [field.astype("<f2").tobytes()]
