"""Units of a table's columns, as people write them.

=============== ======================================================================================
kind            spellings (case, spaces, superscripts and the two Unicode µ do not matter)
=============== ======================================================================================
degrees         deg, degree(s), °, arcmin, arcsec
radians         rad, radian(s), mrad
length          nm, µm, um, micron(s), mm, m, Å, angstrom, and the full names
wavenumber      cm^-1, cm-1, 1/cm
share           %, percent, pct, ‰, ppm; 1, - or fraction
per steradian   1/sr, sr^-1, sr-1, /sr, per sr, 1/msr, 1/µsr, %/sr
V, A            V, mV, µV, A, nA …
signal          counts, DN, ADU, a.u., W/m²/sr …: any factor of proportionality
=============== ======================================================================================
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

__all__ = ["SIGNALS", "Unit", "parse_unit", "plain_text"]

#: Kinds of units that leave a factor of proportionality open.
SIGNALS = ("signal", "V", "A")

_PREFIXES = dict(zip(("", *"kmunp"), (1.0, 1e3, 1e-3, 1e-6, 1e-9, 1e-12), strict=True))
_LETTERS = "θ=theta ϑ=theta Θ=theta φ=phi ϕ=phi Φ=phi λ=lambda σ=sigma ρ=rho ψ=psi μ=u"
_SPELT = {**dict(pair.split("=") for pair in _LETTERS.split()), **dict.fromkeys("Δδ", "delta ")}


@dataclass(frozen=True)
class Unit:
    """A unit that is understood.

    Attributes
    ----------
    text
        As messages show it.
    kind
        One of the table above.
    factor
        To degrees, radians, nm, 1/cm, 1, 1/sr, or the unit without its prefix.
    """

    text: str
    kind: str
    factor: float = 1.0


def _table() -> dict[str, Unit]:
    found: dict[str, Unit] = {}

    def add(words: str, unit: Unit) -> None:
        found.update(dict.fromkeys(words.split(), unit))

    add("deg degs degree degrees °", Unit("deg", "degrees"))
    add("arcmin arcminute arcminutes '", Unit("arcmin", "degrees", 1 / 60))
    add("arcsec arcsecond arcseconds", Unit("arcsec", "degrees", 1 / 3600))
    add("rad rads radian radians", Unit("rad", "radians"))
    add("mrad milliradian milliradians", Unit("mrad", "radians", 1e-3))
    add("nm nanometer nanometers nanometre nanometres", Unit("nm", "length"))
    add("um micron microns micrometer micrometers micrometre micrometres", Unit("µm", "length", 1e3))
    add("mm millimeter millimetre", Unit("mm", "length", 1e6))
    add("m meter meters metre metres", Unit("m", "length", 1e9))
    add("å angstrom angstroms ångström ångströms", Unit("Å", "length", 0.1))
    add("cm-1 1/cm cm^-1 percm kayser", Unit("1/cm", "wavenumber"))
    add("% percent pct percentage perc percents 0-100", Unit("%", "share", 0.01))
    add("‰ permille permil", Unit("‰", "share", 1e-3))
    add("ppm", Unit("ppm", "share", 1e-6))
    add("1 - -- none unitless dimensionless fraction frac ratio 0-1 0..1 n/a 1/1 []", Unit("1", "share"))
    add("a.u. au a.u arb arb. arb.u. arb.units arb.unit arbitrary arbitraryunits", Unit("a.u.", "signal"))
    add("counts count cts dn adu lsb digits electrons e-", Unit("counts", "signal"))
    return found


_UNITS = _table()
#: %, prefix and exponent of an inverse solid angle.
_PER_SOLID_ANGLE = re.compile(
    r"(?:(?P<one>1|%)?/|per)(?P<over>[mu]|milli|micro)?(?:sr|steradians?)"
    r"|(?P<share>1|%)?(?P<power>[mu])?(?:sr|steradian)\^?-1|(?:inverse|inv)(?P<inverse>[mu])?(?:sr|steradians?)"
)
_SIGNAL = re.compile(r"(?P<prefix>[kmunp]?)(?P<base>v|volts?|a|amps?|amperes?)")
_POWER = re.compile(r"[kmunp]?w(?:att)?s?(?:[/*·^( -].*|m\^?-?2.*|sr.*)?|cd(?:/m\^?2|m\^?-2)|lx|lux|nits?")


def plain_text(text: str) -> str:
    """Text with Greek letters, superscripts, subscripts and the kinds of minus and micro spelt in ASCII."""
    text = unicodedata.normalize("NFKC", text.replace("ᵢ", "i"))
    for letter, name in _SPELT.items():
        text = text.replace(letter, name)
    return re.sub("[−–]", "-", text).strip()


def parse_unit(text: str) -> Unit | None:
    """The unit that a text is; None if it is none that is understood."""
    key = re.sub(r"[\s{}\\$]", "", plain_text(text).lower()).replace("**", "^").strip("[]")
    key = re.sub(r"\((-\d|m?sr)\)", r"\1", key)
    if key.startswith("(") and key.endswith(")"):
        key = key[1:-1]
    found = _UNITS.get(key) or _UNITS.get(key.rstrip("."))
    if found is not None:
        return found
    match = _PER_SOLID_ANGLE.fullmatch(key)
    if match:
        word = match["over"] or match["power"] or match["inverse"] or ""
        prefix = "u" if word == "micro" else word[:1]
        share = "%" if "%" in (match["one"], match["share"]) else "1"
        factor = (0.01 if share == "%" else 1.0) / _PREFIXES[prefix]
        return Unit(f"{share}/{'µ' if prefix == 'u' else prefix}sr", "per steradian", factor)
    match = _SIGNAL.fullmatch(key)
    if match:
        base = "V" if match["base"][0] == "v" else "A"
        prefix = match["prefix"]
        return Unit(f"{'µ' if prefix == 'u' else prefix}{base}", base, _PREFIXES[prefix])
    if _POWER.fullmatch(key):
        return Unit(text.strip(), "signal")
    return None
