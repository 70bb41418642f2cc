"""What the page can choose from: models with their parameters, bundled paints, quantities, colours."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from pbrdf.data.paints import PAINTS, load_paint
from pbrdf.explorer.state import MOST_LAYERS, QUANTITIES, VERSION
from pbrdf.models.base import PARTS, Model
from pbrdf.models.parameters import Parameter
from pbrdf.models.registry import MODELS

__all__ = ["catalogue", "layer_of", "state_of"]

#: Colour tables by what they are for, Matplotlib's names: even steps look even, also to the colour-blind.
COLOURS = {"sequential": "cividis", "signed": "RdBu_r", "cyclic": "twilight"}
#: Lengths of strokes and gaps of the lines of :mod:`pbrdf.report.together.curves`, in their order; none for no gaps.
_DASHES: tuple[tuple[float, ...], ...] = ((), (7.0, 3.0), (7.0, 2.5, 1.5, 2.5), (1.5, 2.5))


def layer_of(name: str, model: Model) -> dict[str, Any]:
    """One model as a layer of the state."""
    return {"name": name, "shown": True, **model.to_dict()}


def state_of(layers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """A state that shows some layers, everything else as by default."""
    return {
        "version": VERSION,
        "layers": list(layers),
        "active": 0,
        "compare": None,
        "light": {"theta_i": 35.0, "stokes": [1.0, 0.0, 0.0, 0.0]},
        "quantities": ["intensity", "dolp"],
        "part": "total",
        "settings": {},
    }


@cache
def catalogue() -> dict[str, Any]:
    """Everything that the page asks for once, as plain JSON."""
    return {
        "version": VERSION,
        "blank": state_of([]),
        "looks": _looks(),
        "quantities": list(QUANTITIES),
        "parts": list(PARTS),
        "models": {
            name: {
                "about": _plain((model.__doc__ or "").strip().splitlines()[0]),
                "parameters": [_parameter(p) for p in model.parameters],
                "options": {
                    key: {"choices": list(choices), "about": _plain(choices.description)}
                    for key, choices in model.options.items()
                },
            }
            for name, model in MODELS.items()
        },
        "paints": [layer_of(name, load_paint(name)) for name in PAINTS],
        "colours": {purpose: _table(name) for purpose, name in COLOURS.items()},
    }


def _parameter(p: Parameter) -> dict[str, Any]:
    low, high = p.domain
    return {
        "name": p.name,
        "symbol": p.symbol,
        "unit": p.unit,
        "about": p.description,
        "lower": p.lower,
        "upper": p.upper,
        "least": low,
        "most": None if math.isinf(high) else high,
        "default": p.default,
        "fitted": p.fitted,
        "logarithmic": p.logarithmic,
    }


def _plain(text: str) -> str:
    """A sentence of a docstring without its markup and what it says to readers of the code."""
    return re.sub(r":\w+:`([^`]*)`", r"\1", text).replace(" (module docstring)", "").replace("``", "")


def _looks() -> list[dict[str, Any]]:
    """Colour, marker and dashes of each layer, those of pbrdf's figures of several models."""
    from pbrdf.report.style import looks_of

    return [
        {"colour": look.colour, "marker": look.marker, "dash": _DASHES[i % len(_DASHES)]}
        for i, look in enumerate(looks_of(MOST_LAYERS))
    ]


def _table(name: str) -> str:
    """A colour table of 256 RGBA entries of a byte each, in base64."""
    from matplotlib import colormaps

    rgba = np.round(colormaps[name](np.linspace(0.0, 1.0, 256)) * 255.0).astype(np.uint8)
    return base64.b64encode(rgba.tobytes()).decode()
