"""A library of materials in one JSON file.

::

    {"format": "pbrdf material library", "version": 1,
     "materials": [{"name": "white", "model": "double-gauss", "options": {...},
                    "unknowns": ["log sigma", "n", ...], "mean": [...], "covariance": [[...], ...],
                    "lower": [...], "upper": [...], "fixed": {"kappa": 0.0},
                    "specimens": 12, "scatter": "estimated", "simulated": false, "wavelength_nm": 550.0,
                    "provenance": ["fitted to panel-1.csv", ...],
                    "fits": {"reduced_chi2": 1.1, "missed": 0.02, "cautions": []}}],
     "calibration": {"names": [...], "scores": [[...], ...], "temperature": 1.0, "measurements": "..."}}

``mean`` and ``covariance`` are those of the unknowns: of the logarithm where it says ``log NAME``, of the square where
``square NAME``, else of the parameter itself in its unit; ``lower`` and ``upper`` bound the parameters of a specimen.
``wavelength_nm`` is null where it is not known, ``calibration`` where there is none. ``fits`` says what the
specimens' fits are worth (:class:`~pbrdf.identification.specimen_fits.SpecimenFits`), null where a number is not known;
files may be without it.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from pbrdf.data.paints import PAINTS, WAVELENGTH, load_paint
from pbrdf.errors import DataError, FitError, ModelError, PbrdfError
from pbrdf.files.atomic import atomic_file
from pbrdf.files.text import read_bytes, utf8
from pbrdf.identification.conformal import Calibration
from pbrdf.identification.material import Material, material_from_model
from pbrdf.identification.specimen_fits import SpecimenFits
from pbrdf.inversion.problem import Space
from pbrdf.models import find_model
from pbrdf.models.parameters import Parameter

__all__ = ["Library", "bundled_library", "read_library"]

FORMAT, VERSION = "pbrdf material library", 1
#: Scatter between specimens that the bundled paints are given, as the paper measured one panel of each.
#: (σ, n, a, k, b, t).
_PAINT_SCATTER = (0.15, 0.02, 0.05, 0.05, 0.05, 0.03)


@dataclass(frozen=True)
class Library:
    """Materials by name, and how measurements of them were calibrated.

    Attributes
    ----------
    materials
        In the order in which they were added.
    calibration
        Of exactly these materials; None where there is none.
    """

    materials: tuple[Material, ...]
    calibration: Calibration | None = None

    def __post_init__(self) -> None:
        names = self.names
        for name in names:
            if names.count(name) > 1:
                raise FitError(f"the library has two materials called {name!r}")
        if self.calibration is not None and self.calibration.names != tuple(names):
            raise FitError("the calibration is of other materials than the library has: calibrate again")

    @property
    def names(self) -> list[str]:
        """Names of the materials."""
        return [material.name for material in self.materials]

    def __getitem__(self, name: str) -> Material:
        for material in self.materials:
            if material.name == name:
                return material
        raise FitError(f"the library has no material {name!r}; it has {', '.join(self.names) or 'none'}")

    def with_material(self, material: Material, *, overwrite: bool = False) -> Self:
        """With one more; the calibration goes, as it was made without it.

        Raises
        ------
        FitError
            If there is one of that name and ``overwrite`` is not set.
        """
        if material.name in self.names and not overwrite:
            raise FitError(
                f"the library has a material {material.name!r} already: choose another name, or replace it"
            )
        others = tuple(m for m in self.materials if m.name != material.name)
        return replace(self, materials=(*others, material), calibration=None)

    def without(self, name: str) -> Self:
        """Without the material of a name; raises FitError if there is none. The calibration goes."""
        gone = self[name]
        return replace(self, materials=tuple(m for m in self.materials if m is not gone), calibration=None)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the file, whole or not at all.

        Raises
        ------
        DataError
            If it cannot be written.
        """
        content = {
            "format": FORMAT,
            "version": VERSION,
            "materials": [_described(material) for material in self.materials],
            "calibration": _calibration_described(self.calibration),
        }
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        with atomic_file(Path(path)) as target:
            target.write_text(text, encoding="utf-8")


def bundled_library() -> Library:
    """The paper's five paints, labelled simulated, with an assumed scatter between panels."""
    materials = []
    for name in PAINTS:
        paint = load_paint(name)
        free = [p.name for p in paint.parameters if p.fitted]
        materials.append(
            material_from_model(
                name,
                paint,
                scatter=dict(zip(free, _PAINT_SCATTER, strict=True)),
                simulated=True,
                wavelength=WAVELENGTH,
                provenance=(
                    "Table 1 of Zhang et al., Infrared and Laser Engineering 46(11), 1117002 (2017): one panel; the "
                    "scatter between panels is assumed, not measured",
                ),
            )
        )
    return Library(tuple(materials))


def read_library(path: str | os.PathLike[str]) -> Library:
    """Read a library.

    Raises
    ------
    DataError
        If the file cannot be read, is no library, or one of its materials is damaged; file and material are named.
    """
    file = Path(path)
    text = utf8(file, read_bytes(file))
    try:
        content = json.loads(text)
    except ValueError as error:
        raise DataError(f"{file}: not JSON, so not a library of materials: {error}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise DataError(f"{file}: not a library of materials; one is made by `pbrdf library add NAME FIT`")
    if content.get("version") != VERSION:
        raise DataError(
            f"{file}: version {content.get('version')!r} of the format, this program reads {VERSION}"
        )
    materials = []
    listed = content.get("materials")
    if not isinstance(listed, list):
        raise DataError(f"{file}: it has no list of materials")
    for number, described in enumerate(listed, start=1):
        name = described.get("name", number) if isinstance(described, dict) else number
        try:
            materials.append(_material(described))
        except PbrdfError as error:
            raise DataError(f"{file}: material {name}: {error}") from error
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
            raise DataError(f"{file}: material {name} is damaged: {reason}") from error
    try:
        return Library(tuple(materials), _calibration(content.get("calibration")))
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{file}: the calibration is damaged: {error}") from error
    except FitError as error:
        raise DataError(f"{file}: {error}") from error


def _unknown_name(p: Parameter) -> str:
    return f"log {p.name}" if p.logarithmic else f"square {p.name}" if p.even else p.name


def _described(material: Material) -> dict[str, Any]:
    space = material.space
    return {
        "name": material.name,
        "model": space.model.name,
        "options": dict(space.options),
        "unknowns": [_unknown_name(p) for p in space.free],
        "mean": material.mean.tolist(),
        "covariance": material.covariance.tolist(),
        "lower": space.lower.tolist(),
        "upper": space.upper.tolist(),
        "fixed": dict(space.fixed),
        "specimens": material.specimens,
        "scatter": material.scatter,
        "simulated": material.simulated,
        "wavelength_nm": _or_null(material.wavelength),
        "provenance": list(material.provenance),
        "fits": {
            "reduced_chi2": _or_null(material.fits.reduced_chi2),
            "missed": _or_null(material.fits.missed),
            "cautions": list(material.fits.cautions),
        },
    }


def _or_null(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _number(stored: Any) -> float:
    return math.nan if stored is None else float(stored)


def _material(described: Mapping[str, Any]) -> Material:
    model = find_model(described["model"])
    known = {_unknown_name(p): p for p in model.parameters}
    for name in described["unknowns"]:
        if name not in known:
            raise ModelError(f"{model.name} has no unknown {name!r}; it has {', '.join(known)}")
    free = tuple(known[name] for name in described["unknowns"])
    lower, upper = (np.array(described[key], dtype=float) for key in ("lower", "upper"))
    if lower.shape != (len(free),) or upper.shape != (len(free),):
        raise DataError(f"lower and upper must have {len(free)} numbers each")
    fixed = {str(name): float(value) for name, value in described["fixed"].items()}
    space = Space(model, dict(described["options"]), free, fixed, lower, upper)
    mean, covariance = (np.array(described[key], dtype=float) for key in ("mean", "covariance"))
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        raise DataError("mean and covariance must be finite")
    fits = described.get("fits", {})
    material = Material(
        name=str(described["name"]),
        space=space,
        mean=mean,
        covariance=covariance,
        specimens=int(described["specimens"]),
        scatter=str(described["scatter"]),
        simulated=bool(described["simulated"]),
        wavelength=_number(described["wavelength_nm"]),
        provenance=tuple(map(str, described["provenance"])),
        fits=SpecimenFits(
            _number(fits.get("reduced_chi2")),
            _number(fits.get("missed")),
            tuple(map(str, fits.get("cautions", ()))),
        ),
    )
    _ = material.model  # raises ModelError where the mean is outside the model's domain
    return material


def _calibration_described(calibration: Calibration | None) -> dict[str, Any] | None:
    if calibration is None:
        return None
    return {
        "names": list(calibration.names),
        "scores": [scores.tolist() for scores in calibration.scores],
        "temperature": calibration.temperature,
        "measurements": calibration.measurements,
    }


def _calibration(described: Mapping[str, Any] | None) -> Calibration | None:
    if described is None:
        return None
    return Calibration(
        tuple(map(str, described["names"])),
        tuple(np.array(scores, dtype=float) for scores in described["scores"]),
        float(described["temperature"]),
        str(described["measurements"]),
    )
