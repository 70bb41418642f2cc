"""How honest identification is: coverage of its sets, calibration of its probabilities, and the best that can be done.

Five materials, the bundled paints with a stated scatter between specimens, and one that the library does not know. For
3, 9 and 42 geometries (I, Q, U), noise of 0.5, 1 and 3 % of the intensity, and a gain that is known or not (log-normal,
e-folded either way), specimens of each material are drawn and measured. For each of these 18 cases:

* coverage of the 95 % sets by material, by the χ² of a linear model and after calibration with other specimens;
* expected calibration error of the probabilities;
* how often the unknown material gets the empty set;
* accuracy of the most probable material, and of the best decision there is: that by the exact likelihood, integrated
  over specimens by importance sampling with the true distributions, on the same measurements.

Beside them what χ² to the mean of each material says, with the noise of the measurement alone.

Usage: ``python benchmarks/identification.py [--specimens 1000] [--exact 200] [--quick] [--json FILE]``.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import pbrdf
from pbrdf.identification.conformal import calibrate, expected_calibration_error, nominal, probabilities
from pbrdf.identification.evidence import GAIN_SPREAD, evidence
from pbrdf.identification.library import bundled_library
from pbrdf.identification.material import Material, material_from_model
from pbrdf.inversion.observations import Observations

CONFIDENCE = 0.95
GEOMETRIES, NOISES = (3, 9, 42), (0.005, 0.01, 0.03)
#: Another paint, as unlike the others as they are unlike each other.
UNSEEN = pbrdf.DoubleGauss(sigma=0.08, n=1.5, a=1.2, k=1.1, b=0.1, t=0.3)
#: Draws for each exact integral, and how many measurements of each material have one.
DRAWS, EXACT = 400, 200


def directions(count: int) -> list[np.ndarray]:
    """θ_i, θ_r, φ in radians of 3, 9 or 42 geometries."""
    if count == 42:
        experiment = pbrdf.open_experiment("white")
        few = experiment.isel(geometry=np.flatnonzero(experiment["group"].values < 3))
        return [few[name].values for name in ("theta_i", "theta_r", "phi")]
    pairs = {
        3: ([30, 50, 65], [30, 35, 75]),
        9: ([30, 30, 30, 50, 50, 50, 65, 65, 65], [20, 30, 45, 35, 50, 65, 50, 65, 75]),
    }[count]
    return [*np.radians(np.array(pairs, dtype=float)), np.zeros(count)]


def modelled(material: Material, values: np.ndarray, angles: list[np.ndarray]) -> np.ndarray:
    """I, Q, U of specimens, shapes (S, P) to (S, 3, G)."""
    space = material.space
    named = {p.name: values[:, i, None] for i, p in enumerate(space.free)} | dict(space.fixed)
    model = space.model.from_values(named, **space.options)
    return np.moveaxis(model.stokes(*(angle[None] for angle in angles))[..., :3], -1, 1)


def measure(
    material: Material,
    count: int,
    angles: list[np.ndarray],
    noise: float,
    gain: bool,
    rng: np.random.Generator,
) -> list[Observations]:
    """Measurements of as many specimens of a material."""
    true = modelled(material, material.draw(count, rng), angles)
    if gain:
        true = true * np.exp(rng.standard_normal(count))[:, None, None]
    made = []
    for one in true:
        std = np.broadcast_to(noise * one[0], one.shape).copy()
        values = one + std * rng.standard_normal(one.shape)
        made.append(Observations(*angles, ("I", "Q", "U"), values, std, (1.0, 0.0, 0.0, 0.0), True))
    return made


def exact_log_evidence(
    materials: tuple[Material, ...],
    data: list[Observations],
    angles: list[np.ndarray],
    gain: bool,
    rng: np.random.Generator,
) -> np.ndarray:
    """Integrated likelihoods by importance sampling about the mode, shape (B, C); see the module.

    A proposal a little wider than the posterior (Student's t with five degrees of freedom, its covariance that of
    Laplace's approximation) keeps the weights bounded.
    """
    from scipy.special import gammaln

    from pbrdf.identification.evidence import posterior

    result = np.empty((len(data), len(materials)))
    freedom = 5.0
    for c, material in enumerate(materials):
        mode, information, centre = posterior(material, data, gain=gain)
        size = mode.shape[1]
        root = np.linalg.cholesky(np.linalg.inv(information))
        for b, one in enumerate(data):
            normal = rng.standard_normal((DRAWS, size))
            chi2 = rng.chisquare(freedom, DRAWS) / freedom
            step = normal / np.sqrt(chi2)[:, None]
            z = mode[b] + step @ root[b].T
            log_proposal = (
                gammaln(0.5 * (freedom + size))
                - gammaln(0.5 * freedom)
                - 0.5 * size * np.log(freedom)
                - 0.5 * (freedom + size) * np.log1p((step**2).sum(axis=1) / freedom)
                - np.linalg.slogdet(root[b])[1]
            )
            own = material.mean + z[:, : len(material.mean)] @ material.root.T
            values = material.space.to_parameters(np.clip(own, *material.space.box))
            signal = modelled(material, values, angles)
            if gain:
                signal = signal * np.exp(centre[b] + GAIN_SPREAD * z[:, -1])[:, None, None]
            misfit = (((signal - one.values) / one.std) ** 2).sum(axis=(1, 2))
            log_weight = -0.5 * misfit - 0.5 * (z**2).sum(axis=1) - log_proposal
            result[b, c] = np.logaddexp.reduce(log_weight)
    return result


def case(
    geometries: int, noise: float, gain: bool, specimens: int, exact: int, rng: np.random.Generator
) -> dict[str, Any]:
    """Numbers of one case."""
    library = bundled_library()
    materials = library.materials
    scatter = np.sqrt(np.diag(materials[0].covariance))
    names = materials[0].space.names
    stranger = material_from_model(
        "unseen", UNSEEN, scatter=dict(zip(names, map(float, scatter), strict=True))
    )
    angles = directions(geometries)
    truth = np.repeat(np.arange(len(materials)), specimens)
    clock = time.perf_counter()
    found = {}
    for use, kinds in (("test", materials), ("calibration", materials), ("unseen", (stranger,))):
        data = [one for kind in kinds for one in measure(kind, specimens, angles, noise, gain, rng)]
        found[use] = (data, evidence(materials, data, gain=gain))
    seconds = time.perf_counter() - clock
    scores = {use: nominal(e.distance, e.degrees_of_freedom) for use, (_, e) in found.items()}
    calibration = calibrate(library.names, found["calibration"][1].log_evidence, scores["calibration"], truth)
    data, result = found["test"]
    share = probabilities(result.log_evidence, None, calibration.temperature)

    def sets(use: str, calibrated: bool) -> np.ndarray:
        p = calibration.p_values(scores[use]) if calibrated else scores[use]
        return p > 1.0 - CONFIDENCE

    def coverage(calibrated: bool) -> list[float]:
        inside = sets("test", calibrated)
        return [float(inside[truth == c, c].mean()) for c in range(len(materials))]

    chosen = np.concatenate([np.flatnonzero(truth == c)[:exact] for c in range(len(materials))])
    best = exact_log_evidence(materials, [data[i] for i in chosen], angles, gain, rng).argmax(axis=1)
    means = [modelled(m, m.space.to_parameters(m.mean)[None], angles)[0] for m in materials]
    naive = np.array([[_misfit(one, mean, gain) for mean in means] for one in data])
    naive_share = probabilities(-0.5 * naive)
    right = result.log_evidence.argmax(axis=1) == truth
    return {
        "geometries": geometries,
        "noise": noise,
        "gain": "unknown" if gain else "known",
        "coverage": coverage(True),
        "coverage_nominal": coverage(False),
        "size": float(sets("test", True).sum(axis=1).mean()),
        "ece": expected_calibration_error(share, truth),
        "ece_uncalibrated": expected_calibration_error(probabilities(result.log_evidence), truth),
        "temperature": calibration.temperature,
        "unseen_empty": float((~sets("unseen", True).any(axis=1)).mean()),
        "accuracy": float(right.mean()),
        "accuracy_there": float(right[chosen].mean()),
        "accuracy_best": float((best == truth[chosen]).mean()),
        "naive_accuracy": float((naive_share.argmax(axis=1) == truth).mean()),
        "naive_confidence": float(naive_share.max(axis=1).mean()),
        "likelihoods_a_second": 3 * result.distance.size / seconds,
    }


def _misfit(one: Observations, mean: np.ndarray, gain: bool) -> float:
    weights = 1.0 / one.std**2
    factor = (weights * one.values * mean).sum() / (weights * mean**2).sum() if gain else 1.0
    return float((weights * (one.values - factor * mean) ** 2).sum())


def main() -> int:
    """Run, print a table, and fail if a promise is not kept."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--specimens", type=int, default=1000, help="of each material, to test and to calibrate"
    )
    parser.add_argument(
        "--exact", type=int, default=EXACT, help="measurements of each material with exact integrals"
    )
    parser.add_argument("--quick", action="store_true", help="100 specimens, a third of the cases")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there")
    options = parser.parse_args()
    specimens = 100 if options.quick else options.specimens
    rng = np.random.default_rng(1)
    clock = time.perf_counter()
    rows = []
    for geometries, gain, noise in itertools.product(
        GEOMETRIES, (False, True), NOISES[1:2] if options.quick else NOISES
    ):
        rows.append(case(geometries, noise, gain, specimens, min(options.exact, specimens), rng))
        print(f"{len(rows)}: {time.perf_counter() - clock:.0f} s", file=sys.stderr, flush=True)
        if options.json is not None:
            options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    table = Table(
        box=SIMPLE_HEAD, title=f"{specimens} specimens a material", title_justify="left", padding=(0, 1)
    )
    for heading in (
        "geometries",
        "gain",
        "noise",
        "coverage %",
        "by χ² %",
        "size",
        "ECE",
        "unseen empty",
        "accuracy",
        "there",
        "best",
        "χ² to the mean (confidence)",
    ):
        table.add_column(heading, justify="right")
    kept = True
    for row in rows:
        low, high = min(row["coverage"]), max(row["coverage"])
        kept &= specimens < 1000 or (
            low >= 0.93
            and high <= 0.97
            and row["ece"] <= 0.02
            and row["unseen_empty"] >= 0.95
            and row["accuracy_there"] >= row["accuracy_best"] - 0.01
        )
        nominal_low, nominal_high = min(row["coverage_nominal"]), max(row["coverage_nominal"])
        table.add_row(
            str(row["geometries"]),
            row["gain"],
            f"{100 * row['noise']:g} %",
            f"{100 * low:.1f} … {100 * high:.1f}",
            f"{100 * nominal_low:.1f} … {100 * nominal_high:.1f}",
            f"{row['size']:.2f}",
            f"{row['ece']:.4f}",
            f"{row['unseen_empty']:.3f}",
            f"{row['accuracy']:.4f}",
            f"{row['accuracy_there']:.3f}",
            f"{row['accuracy_best']:.3f}",
            f"{row['naive_accuracy']:.3f} ({row['naive_confidence']:.3f})",
        )
    Console(width=160).print(table, highlight=False)
    rates = [row["likelihoods_a_second"] for row in rows]
    print(f"{min(rates):.0f} … {max(rates):.0f} integrated likelihoods a second")
    if not kept:
        print("a promise is not kept", file=sys.stderr)
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
