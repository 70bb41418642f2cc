"""What the name of a column says: which variable, in which unit, and whether it is an uncertainty, of what kind.

A name that could mean two things is not understood: DoP is not DoLP, ``azimuth`` may be relative or absolute, ``u`` and
``v`` may be projected coordinates. Such columns are left to the options.

Expanded uncertainties follow the GUM (JCGM 100:2008): U = k u, with the coverage factor k.
"""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass

from pbrdf.data.formats.csv_table.ratios import RATIO_ELEMENTS, ratio_variable
from pbrdf.data.formats.csv_table.units import parse_unit, plain_text
from pbrdf.data.schema import VARIABLES, std_name
from pbrdf.optics.stokes import STOKES

__all__ = [
    "AZIMUTHS",
    "CHANNELS",
    "COLUMNS",
    "COVARIANCES",
    "ELEMENTS",
    "GUESSED",
    "LONGEST",
    "MISSING",
    "Name",
    "parse_name",
]

ELEMENTS = tuple(f"m{i}{j}" for i in range(4) for j in range(4))
CHANNELS = (*(name for name in VARIABLES if not name.startswith("mueller")), *ELEMENTS, *RATIO_ELEMENTS)
#: Columns of the covariance by the position of their entry, the upper triangle with the diagonal.
COVARIANCES = {(i, j): f"cov_{STOKES[i]}{STOKES[j]}" for i in range(4) for j in range(i, 4)}
#: Azimuths of source and viewer, counted from a line on the sample; together they make phi.
AZIMUTHS = ("phi_i", "phi_r")
COLUMNS = (
    *("theta_i", "theta_r", "phi", *AZIMUTHS, "wavelength", "group"),
    *CHANNELS,
    *map(std_name, CHANNELS),
    *COVARIANCES.values(),
)

# Keys are lower case without separators and without the word "angle" at the end.
_SYNONYMS = {
    "theta_i": "thetain thetainc thetaincident thetaincidence thetasource thetasun thetalight thi incidence "
    "incidenceangle angleofincidence aoi zenithi zenithin zenithinc incident incidentzenith incidencezenith "
    "incomingzenith inczenith solarzenith sunzenith sza sourcezenith lightzenith illuminationzenith illumination "
    "zenithincident zenithsource anglein anglei incoming",
    "theta_r": "thetao thetaout thetav thetaview thetaviewing thetareflected thetarefl thetareflection thetadetector "
    "thetadet thetaobs thetascatter thetascattered thr zenithr zenitho zenithout zenithv zenithview viewzenith "
    "viewingzenith vza view viewing measure measurement sensorzenith detectorzenith detector observation "
    "observationzenith observerzenith reflection reflected reflectedzenith angleofreflection exit emission emergence "
    "exitzenith outgoing outgoingzenith receiver receiverzenith scatterzenith zenithreflected angleout angler",
    "phi": "relativeazimuth relazimuth raa dphi deltaphi azimuthdifference azimuthrelative azimuthrel phirel "
    "phirelative relphi relaz deltaazimuth relativeazimuthal",
    "phi_i": "phiin phiinc phiincident phisource phisun phiincidence azimuthi azimuthin azimuthinc azimuthincident "
    "azii aziin incidentazimuth incidenceazimuth sourceazimuth lightazimuth illuminationazimuth solarazimuth "
    "sunazimuth saa azimuthsource incazimuth incomingazimuth",
    "phi_r": "phio phiout phiv phiview phireflected phirefl phidetector phidet phiobs phiscatter phiscattered azimuthr "
    "azimutho azimuthout azimuthv azimuthview azimuthviewing azir azio aziout viewazimuth viewingazimuth "
    "sensorazimuth detectorazimuth observerazimuth observationazimuth reflectedazimuth reflectionazimuth "
    "outgoingazimuth exitazimuth scatterazimuth vaa azimuthreflected azimuthdetector measureazimuth receiverazimuth",
    "wavelength": "lambda lam wl wvl wavelen wavelengths wave wavenumber",
    "group": "position cameraposition",
    "I": "s0 intensity brdf bsdf fr reflectancefactor bidirectionalreflectancefactor brf radiancefactor reflectance "
    "radiance dn",
    "Q": "s1",
    "U": "s2",
    "V": "s3",
    "dolp": "degreeoflinearpolarization degreeoflinearpolarisation",
    "aolp": "angleoflinearpolarization angleoflinearpolarisation",
}
_VARIABLE_OF = {name.lower().replace("_", ""): name for name in COLUMNS}
_VARIABLE_OF |= {synonym: name for name, synonyms in _SYNONYMS.items() for synonym in synonyms.split()}
# A covariance may name its two components in either order.
_VARIABLE_OF |= {f"cov{STOKES[j]}{STOKES[i]}".lower(): name for (i, j), name in COVARIANCES.items()}
_VARIABLE_OF |= {f"covs{a}s{b}": name for (i, j), name in COVARIANCES.items() for a, b in ((i, j), (j, i))}
# Angles that are counted from the horizon.
_ELEVATIONS = {
    f"{who}{what}": variable
    for variable, whose in (
        ("theta_i", "solar sun source incident incidence light"),
        ("theta_r", "view viewing sensor detector reflected observer"),
    )
    for who in whose.split()
    for what in ("elevation", "altitude")
}
_ELEVATIONS |= {"elevationi": "theta_i", "elevationin": "theta_i", "elevi": "theta_i"}
_ELEVATIONS |= {
    "elevationr": "theta_r",
    "elevationo": "theta_r",
    "elevationout": "theta_r",
    "elevr": "theta_r",
}

_QUANTITY_OF = {
    "brdf": "brdf",
    "bsdf": "brdf",
    "fr": "brdf",
    "reflectancefactor": "reflectance_factor",
    "bidirectionalreflectancefactor": "reflectance_factor",
    "brf": "reflectance_factor",
    "radiance": "radiance",
    "dn": "dn",
}
#: Names that are mostly, not always, used for a reflectance factor.
GUESSED = {
    "radiancefactor": "reflectance_factor",
    "reflectance": "reflectance_factor",
    "r": "reflectance_factor",
}

#: Texts of cells, in lower case, where nothing was measured.
MISSING = frozenset(("", "nan", "na"))

#: Characters of the longest name, or comment, that is looked into.
LONGEST = 200

_BRACKET = re.compile(r"\[([^\]]*)\]|\(([^()]*(?:\([^()]*\)[^()]*)*)\)|\{([^}]*)\}")
_COVERAGE = re.compile(r"k\s*=?\s*(\d+(?:\.\d+)?)")
_MULTIPLE_SIGMA = re.compile(r"(\d+(?:\.\d+)?)\s*[-_ ]?\s*(?:sigma|sd|std)")
_STANDARD_WORDS = (
    "std sd stdev stddev stderr unc uncert uncertainty uncertainties err error errors sigma sig se sem"
)
_STANDARD = frozenset(_STANDARD_WORDS.split())
_VARIANCE = frozenset(("var", "variance"))
_BESIDE = frozenset(
    ("standard", "expanded", "combined", "deviation", "dev", "of", "in", "the", "total", "absolute")
)
_BESIDE |= {"abs", "relative", "rel", "type", "random", "measurement"}
#: Alone they may be something else than the uncertainty of the values.
_VAGUE_WORDS = "err error errors sigma sig se var u"
_VAGUE = frozenset(_VAGUE_WORDS.split())
_FILLERS = frozenset(
    ("stokes", "parameter", "measured", "panel", "value", "values", "mean", "average", "avg")
)
#: Elements of scattering matrices are called S, F or Z, those of BRDFs f_r.
_ELEMENT = re.compile(r"(?:m|mueller|mm|s|f|f_?r|z)[ _]?[\[({]?(\d)[\])},;\s_]*[\[({]?(\d)[\])}]?")
_DIFFERENTIAL = re.compile(r"d_?([IQUVR]|S[0-3]|BRDF|brdf|DoLP|dolp|DOLP|AoLP|aolp)")
_CODED = re.compile(r"(?:(u)|(U))_?(95|k\d)?")  # u or U, U95, U_k2


@dataclass(frozen=True)
class Name:
    """What a column's name says.

    Attributes
    ----------
    text
        The name as the file has it.
    variable
        One of :data:`COLUMNS`, without ``_std``; of an uncertainty the variable that it belongs to; None where the name
        says none.
    unit
        The text of a unit, understood or not; None where there is none.
    quantity
        Quantity that the name says, for I.
    key
        The name's words without separators, units and signs of an uncertainty, in lower case.
    uncertainty
        ``"standard"``, ``"expanded"``, ``"variance"``, ``"vague"``; None for no uncertainty.
    coverage
        Coverage factor of an expanded uncertainty; None where the name does not say it.
    relative
        Whether the uncertainty is relative to the value.
    elevation
        Whether the angle is counted from the horizon.
    element
        Indices of a Mueller element, as the name counts them.
    """

    text: str
    variable: str | None = None
    unit: str | None = None
    quantity: str | None = None
    key: str = ""
    uncertainty: str | None = None
    coverage: float | None = None
    relative: bool = False
    elevation: bool = False
    element: tuple[int, int] | None = None


class _Parts:
    """A name while it is taken apart."""

    def __init__(self, name: str) -> None:
        self.rest = _without_tex(plain_text(name))
        self.unit: str | None = None
        self.coverage: float | None = None
        self.expanded = self.standard = self.relative = False
        self.inner = ""

    def coverage_factor(self) -> None:
        """``k = 2`` outside of brackets."""
        match = re.search(r"[,;:_\s]+k\s*=\s*(\d+(?:\.\d+)?)\s*$", self.rest)
        if match:
            self._covered(float(match[1]))
            self.rest = self.rest[: match.start()]

    def brackets(self) -> None:
        for match in list(_BRACKET.finditer(self.rest)):
            content = next(group for group in match.groups() if group is not None)
            self.rest = self.rest.replace(match[0], " ", 1)
            # W/(m² sr) and the like hold no separator between hints
            for part in re.split(r"[,;]", content):
                self._hint(part.strip())
        self.rest = self.rest.strip(" /,;:|")

    def _hint(self, text: str) -> None:
        lowered = text.lower()
        words = lowered.split()
        if _COVERAGE.fullmatch(lowered):
            self._covered(float(_COVERAGE.fullmatch(lowered)[1]))  # type: ignore[index]
        elif _MULTIPLE_SIGMA.fullmatch(lowered):
            self._covered(float(_MULTIPLE_SIGMA.fullmatch(lowered)[1]))  # type: ignore[index]
        elif (
            re.fullmatch(r"(\d\d(\.\d+)?\s*%)( (confidence|ci|coverage|level))*", lowered) and lowered != "0%"
        ):
            self.expanded = True
        elif words and set(words) <= {"rel", "relative", "rel."}:
            self.relative = True
        elif len(words) > 1 and words[0] in ("rel", "relative", "rel.") and parse_unit(words[1]):
            self.relative, self.unit = True, words[1]
        elif words and set(words) <= {"standard", "std", "abs", "absolute", "uncertainty"}:
            self.standard = True
        elif lowered == "expanded":
            self.expanded = True
        elif _is_owner(text) and parse_unit(text) is None:
            self.inner = text
        elif lowered:
            self.unit = text

    def _covered(self, k: float) -> None:
        self.coverage = k
        if k == 1.0:
            self.standard = True
        else:
            self.expanded = True

    def suffix(self) -> None:
        """A unit after a separator: ``theta_i / deg``, ``BRDF, 1/sr``, ``BRDF sr^-1``."""
        for position, letter in enumerate(self.rest):
            if letter not in "/,;| " or not self.rest[:position].strip():
                continue
            tail = self.rest[position + 1 :].strip()
            unit = parse_unit(tail)
            if unit is None or unit.kind == "signal":
                continue
            # "Stokes V" is no voltage, "Sample 1" no share
            if letter == " " and (unit.kind in ("V", "A") or tail in "1-m"):
                continue
            self.unit = self.unit or tail
            self.rest = self.rest[:position].strip(" /,;:|")
            return

    def words(self) -> list[str]:
        rest = re.sub(r"(?<=[\s_])sr\^?-1$", "per sr", self.rest)
        words = [word for word in re.split(r"[\s_.,:;\-]+", rest) if word]
        for count in (3, 2, 1):
            while len(words) > count:
                tail = "".join(words[-count:])
                unit = parse_unit(tail) if tail not in ("1", "sr1") else None
                if unit is None or unit.kind in ("signal", "V", "A") or (tail == "m" and len(words) > 2):
                    break
                self.unit = self.unit or tail
                words = words[:-count]
        return words


@functools.lru_cache(maxsize=4096)
def parse_name(name: str) -> Name:
    """Take a column's name apart; see :class:`Name`. One longer than any name is said to be none that is understood."""
    if len(name) > LONGEST:
        return Name(name)
    text = _without_tex(plain_text(name))
    if (ratio := ratio_variable(text)) is not None:
        return Name(name, ratio, key=ratio)
    element = _ELEMENT.fullmatch(text.lower())
    if element:
        return _element(name, int(element[1]), int(element[2]))
    if re.match(r"±|\+\s*/?\s*-", text) or text.endswith("±"):
        owner = parse_name(re.sub(r"^(±|\+\s*/?\s*-)|±$", "", text))
        return Name(name, owner.variable, owner.unit, key=owner.key, uncertainty="vague")
    parts = _Parts(name)
    parts.coverage_factor()
    parts.brackets()
    parts.suffix()
    words = parts.words()
    if parts.inner:
        words = [*words, *re.split(r"[\s_\-]+", parts.inner)]
    kind, words = _uncertainty(words, parts)
    lowered = [word.lower() for word in words]
    if len(lowered) > 1:
        lowered = [word for word in lowered if word not in _FILLERS] or lowered
    key = "".join(lowered)
    indices = _ELEMENT.fullmatch(key)
    variable, elevation = _variable(key), False
    if variable is None and key in _ELEVATIONS:
        variable, elevation = _ELEVATIONS[key], True
    if key == "azimuth" and parts.relative:
        variable = "phi"
    quantity = _QUANTITY_OF.get(key)
    if variable is None and key == "r" and (words[-1:] == ["R"] or parts.unit):
        variable = "I"
    unit = parts.unit
    if key == "wavenumber" and unit is None:
        unit = "wavenumber"
    relative = parts.relative or (kind is not None and bool({"rel", "relative"} & _all_words(parts.rest)))
    return Name(
        name, variable, unit, quantity, key, kind, parts.coverage, relative, elevation,
        (int(indices[1]), int(indices[2])) if indices else None,
    )  # fmt: skip


def _without_tex(text: str) -> str:
    """``$\\sigma_{f_r}$`` as sigma_f_r."""
    return re.sub(r"_\{([^{}]*)\}", r"_\1", re.sub(r"[$\\]", "", text))


def _element(name: str, i: int, j: int) -> Name:
    variable = f"m{i}{j}"
    return Name(name, variable if variable in ELEMENTS else None, key=variable, element=(i, j))


def _variable(key: str) -> str | None:
    key = re.sub(r"[\s_\-]", "", key.lower())
    short = re.sub(r"angles?$", "", key)
    found = _VARIABLE_OF.get(key) or _VARIABLE_OF.get(short) or ratio_variable(key)
    # only the words of a direction may stand alone with "angle" after them
    if found in ("theta_i", "theta_r") and key == short and key in _NEEDS_ANGLE:
        return None
    return found


_NEEDS_ANGLE = frozenset(
    [
        "incident",
        "illumination",
        "view",
        "viewing",
        "measure",
        "measurement",
        "detector",
        "observation",
        "reflection",
        "reflected",
        "exit",
        "emission",
        "emergence",
        "outgoing",
        "incoming",
        "receiver",
    ]
)


def _all_words(text: str) -> set[str]:
    return set(re.split(r"[\s_.,:;\-]+", text.lower()))


def _uncertainty(words: list[str], parts: _Parts) -> tuple[str | None, list[str]]:
    """The kind of uncertainty that the words speak of, and those left that say of what."""
    words = _with_multiples(words)
    lowered = [word.lower() for word in words]
    joined = "".join(words)
    if match := _DIFFERENTIAL.fullmatch("_".join(words)) or _DIFFERENTIAL.fullmatch(joined):
        return "standard", [match[1]]
    for i, word in enumerate(lowered):
        multiple = re.fullmatch(r"(\d+(?:\.\d+)?)(sigma|sd|std)", word)
        if multiple:
            parts._covered(float(multiple[1]))
            lowered[i] = words[i] = "std"
        elif re.fullmatch(r"k\d", word) and len(words) > 1:
            parts._covered(float(word[1:]))
            words[i] = lowered[i] = "of"
    glued = re.fullmatch(r"(sigma|delta|unc|err|std)([iquv]|s[0-3]|brdf|dolp|aolp)", "".join(lowered))
    if glued:
        return _kind(parts, "standard"), [glued[2]]
    signs = [word for word in lowered if word in _STANDARD]
    if len(words) > 1 and re.fullmatch("U(95)?", words[-1]) and _is_owner("".join(words[:-1])):
        parts.expanded = parts.coverage != 1.0
        return _kind(parts, "standard"), words[:-1]
    if "standard" in lowered and {"deviation", "dev", "error"} & set(lowered):
        signs.append("std")
    if "expanded" in lowered and (signs or len(lowered) == 1):
        parts.expanded = True
        signs.append("uncertainty")
    if signs:
        left = [w for w, low in zip(words, lowered, strict=True) if low not in _STANDARD | _BESIDE]
        # U_std is the deviation of the Stokes parameter U, U_rel and U the uncertainty itself
        vague = not left and set(signs) <= _VAGUE and "standard" not in lowered
        return _kind(parts, "vague" if vague else "standard"), left
    if _VARIANCE & set(lowered):
        left = [w for w, low in zip(words, lowered, strict=True) if low not in _VARIANCE | _BESIDE]
        return "variance" if left else "vague", left
    if words and (match := _CODED.fullmatch(words[0])):
        left = [w for w, low in zip(words[1:], lowered[1:], strict=True) if low not in _BESIDE | {"95", "c"}]
        said = match[3] or parts.expanded or parts.standard or parts.relative or len(left) < len(words) - 1
        owner = bool(left) and _is_owner("".join(left))
        if said or owner or parts.inner:
            if match[3] and match[3] != "95":
                parts._covered(float(match[3][1:]))
            elif match[2] and not parts.standard:
                parts.expanded = True
            return _kind(parts, "standard"), left
    if len(words) == 2 and lowered[0] == "s" and words[1] in STOKES:
        return "vague", words[1:]  # or values in s-polarised light
    if words and re.fullmatch(r"u[IQUV]", words[0]) and len(words) == 1:
        return _kind(parts, "standard"), [words[0][1]]
    if words and re.fullmatch(r"U[IQ]", words[0]) and len(words) == 1:
        parts.expanded = True
        return "expanded", [words[0][1]]
    if parts.expanded and words:
        return "expanded", [w for w, low in zip(words, lowered, strict=True) if low not in ("u", "u95")]
    return None, words


def _with_multiples(words: list[str]) -> list[str]:
    """The words with ``2 sigma`` as one."""
    joined: list[str] = []
    for word in words:
        if joined and re.fullmatch("sigma|sd|std", word.lower()) and re.fullmatch(r"[1-9]", joined[-1]):
            joined[-1] += word
        else:
            joined.append(word)
    return joined


def _is_owner(text: str) -> bool:
    """Whether an uncertainty may be that of a variable of this name."""
    return text == "R" or _variable(text) is not None


def _kind(parts: _Parts, otherwise: str) -> str:
    return "expanded" if parts.expanded else otherwise
