"""What is drawn of polarised light beside intensity and DoLP: Q/I, U/I, V/I, its angle, or Mueller elements.

The same function makes them of measured and of modelled values, so that they can be compared. The angle of linear
polarisation is ½ atan2(U, Q), 0° parallel to the plane of scattering (p), 90° across it (s), within −45° … 135° so that
neither of the two lies on an end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

__all__ = [
    "Channel",
    "channels_behind",
    "is_element",
    "is_intensity",
    "polarised_quantities",
    "quantity_label",
    "quantity_of",
]

#: Standard uncertainties that the polarised light must exceed for its angle to be drawn.
_DETECTED = 2.0
#: Degree of linear polarisation below which light has no angle worth drawing.
_UNPOLARISED = 0.002


@dataclass(frozen=True)
class Channel:
    """One quantity over the geometries; NaN where there is nothing.

    Attributes
    ----------
    measured, std
        Values and their standard uncertainties, shape (G,).
    """

    measured: np.ndarray
    std: np.ndarray


def polarised_quantities(
    values: Mapping[str, np.ndarray], std: Mapping[str, np.ndarray] | None = None
) -> dict[str, Channel]:
    """Quantities of polarised light by name: ``"Q/I"``, ``"U/I"``, ``"V/I"``, ``"aolp"`` (°), or ``"m00"`` … ``"m33"``.

    Parameters
    ----------
    values
        Some of ``I``, ``Q``, ``U``, ``V``, or Mueller elements ``m00`` …, or what was measured as a ratio,
        ``Q_over_I`` … or ``m01_over_m00`` …, shape (G,) each; what is NaN throughout counts as absent.
    std
        Their standard uncertainties; None, or absent ones, for unknown.

    Returns
    -------
    dict
        Elements but ``m00`` are divided by ``m00``. The uncertainties are of first order, errors taken as independent.
    """
    std = std or {}
    present = {name: v for name, v in values.items() if np.isfinite(v).any()}
    elements = [name for name in sorted(present) if is_element(name)]
    found: dict[str, Channel] = {}
    ratios = {name.partition("_over_")[::2]: name for name in present if "_over_" in name}
    for (part, whole), name in sorted(ratios.items()):
        nothing = np.full(present[name].shape, np.nan)
        found[part if whole == "m00" else f"{part}/I"] = Channel(present[name], std.get(name, nothing))
    if elements:
        nothing = np.full(present[elements[0]].shape, np.nan)
        for name in elements:
            if name == "m00":
                found[name] = Channel(present[name], std.get(name, nothing))
            elif "m00" in present:
                found[name] = _ratio(present, std, name, "m00")
        return found
    for name in "QUV":
        if name in present and "I" in present:
            found[f"{name}/I"] = _ratio(present, std, name, "I")
    if "Q/I" in found and "U/I" in found:
        found["aolp"] = _angle(found["Q/I"], found["U/I"])
    return found


def channels_behind(name: str) -> tuple[str, ...]:
    """Channels of a fit of which a quantity is made, ``"intensity"`` and ``"dolp"`` included."""
    if name in ("intensity", "dolp"):
        return ("I" if name == "intensity" else name,)
    if name == "aolp":
        return ("I", "Q", "U")
    return ("m00", name) if is_element(name) else ("I", name[0])


def quantity_of(name: str, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """A quantity from the values of :func:`channels_behind`."""
    needed = channels_behind(name)
    if name in ("intensity", "dolp"):
        return values[needed[0]]
    made = polarised_quantities({channel: values[channel] for channel in needed})
    return made[name].measured if name in made else np.full(values[needed[0]].shape, np.nan)


def quantity_label(name: str) -> str:
    """Name of one of these for an axis."""
    if name == "aolp":
        return "angle of linear polarisation (°)"
    return f"{name}/m00" if is_element(name) and name != "m00" else name


def is_element(name: str) -> bool:
    """Whether this names an element of a Mueller matrix."""
    return len(name) == 3 and name[0] == "m" and name[1:].isdigit()


def is_intensity(name: str) -> bool:
    """Whether this is a quantity that is positive and may span decades."""
    return name in ("intensity", "m00")


def _ratio(
    values: Mapping[str, np.ndarray], std: Mapping[str, np.ndarray], name: str, reference: str
) -> Channel:
    nothing = np.full(values[name].shape, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = values[name] / values[reference]
        spread = np.hypot(std.get(name, nothing), ratio * std.get(reference, nothing))
        return Channel(ratio, spread / np.abs(values[reference]))


def _angle(q: Channel, u: Channel) -> Channel:
    """The angle of linear polarisation where it stands out of its noise, degrees."""
    degree = np.hypot(q.measured, u.measured)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = np.hypot(u.measured * q.std, q.measured * u.std) / degree
        angle = 0.5 * np.rad2deg(np.arctan2(u.measured, q.measured))
        angle = np.where(angle < -45.0, angle + 180.0, angle)
        spread = np.rad2deg(0.5 * across / degree)
    hidden = (degree < _UNPOLARISED) | (
        degree < _DETECTED * np.fmax(np.nan_to_num(q.std), np.nan_to_num(u.std))
    )
    return Channel(np.where(hidden, np.nan, angle), np.where(hidden, np.nan, spread))
