"""What one reading more really tells of the material, against what ``next_measurement`` expects of it.

Two candidates remain after a few readings of a paint. Specimens of both that these readings allow are drawn (from the
library, weighted by their likelihood, the unknown gain with them), each is measured once more at a geometry, with
noise, and identified with that reading too. The mean of log₂ of what the true material's probability grew by is the
information; beside it stand how often the most probable material is the true one, and how many are left in the set.

    python benchmarks/identification_next.py [--specimens 1000]

docs/identification-accuracy.md holds the table.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

import pbrdf
from pbrdf.identification.conformal import nominal, probabilities
from pbrdf.identification.evidence import evidence
from pbrdf.identification.identify import Identification, identify
from pbrdf.identification.library import Library, bundled_library
from pbrdf.identification.material import Material
from pbrdf.identification.predictive import specimens_shown
from pbrdf.inversion.observations import Observations

#: Paint, geometries so far (degrees), noise, whether the gain is not known, and the candidates.
CASES = (
    ("cd-back", [(40, 20)], 0.03, False, ("cd-back", "matte-white-thick")),
    ("cd-back", [(40, 20)], 0.03, True, ("cd-back", "matte-white-thick")),
    ("matte-white-thin", [(40, 20), (50, 30)], 0.03, True, ("matte-white-thin", "cd-back")),
    ("cd-back", [(40, 20), (50, 20)], 0.10, False, ("cd-back", "matte-white-thick")),
)
#: Geometries beside the best one, degrees.
OTHERS = ((73, 67), (65.2, 69.8), (43.3, 66.7), (50, 80))
DRAWN = 20_000


def measured(paint: str, angles: list[tuple[float, float]], noise: float) -> Observations:
    """The paint as it is in the library's mean, with noise."""
    theta_i, theta_r = np.radians(np.array(angles, dtype=float)).T
    stokes = pbrdf.load_paint(paint).stokes(theta_i, theta_r, 0.0 * theta_i)
    rng = np.random.default_rng(0)
    std = noise * stokes[:, 0]
    values = {n: stokes[:, i] + std * rng.standard_normal(len(std)) for i, n in enumerate("IQU")}
    std_of = dict.fromkeys(values, std)
    data = pbrdf.make_dataset(theta_i, theta_r, 0.0 * theta_i, quantity="brdf", **values, std=std_of)
    return Observations.from_dataset(data, None)


def shown(material: Material, parameters: np.ndarray, at: Observations) -> np.ndarray:
    """Signals of specimens, shape (S, K, G)."""
    found = specimens_shown(material, parameters, at, at.channels)
    return np.stack([found[name] for name in at.channels], axis=1)


def allowed(
    found: Identification, material: Material, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters and gains of specimens that the data so far allow."""
    data = found.data
    assert data is not None
    drawn = material.draw(DRAWN, rng)
    modelled = shown(material, drawn, data)
    weights = 1.0 / data.std**2
    gains = np.ones(DRAWN)
    log_width = np.zeros(DRAWN)
    if found.gain:
        # given a specimen, the likelihood of the gain is normal; its prior is flat beside it
        precision = (weights * modelled**2).sum(axis=(1, 2))
        gains = (weights * modelled * data.values).sum(axis=(1, 2)) / precision
        log_width = -0.5 * np.log(precision) - np.log(np.maximum(gains, 1e-300))
    misfit = (weights * (gains[:, None, None] * modelled - data.values) ** 2).sum(axis=(1, 2))
    log_weight = -0.5 * misfit + log_width
    weight = np.exp(log_weight - log_weight.max())
    chosen = rng.choice(DRAWN, count, p=weight / weight.sum())
    gains = gains[chosen]
    if found.gain:
        gains = gains + rng.standard_normal(count) / np.sqrt(precision[chosen])
    return drawn[chosen], gains


def told(
    found: Identification, library: Library, place: tuple[float, ...], noise: float, count: int
) -> tuple[float, float, float, float]:
    """Bits and their standard error, rate of right choices, and candidates left, simulated at a geometry."""
    data, rng = found.data, np.random.default_rng(1)
    assert data is not None
    p = np.array([found[name].probability for name in library.names])
    p = p / p.sum()
    angles = np.radians(np.array(place))
    nothing = np.ones((len(data.channels), 1))
    named = zip(("theta_i", "theta_r", "phi"), angles, strict=True)
    at = replace(
        data,
        **{name: np.array([a]) for name, a in named},
        values=nothing,
        std=nothing,
        group=None,
        scale=None,
    )
    batch, truth = [], []
    for c, material in enumerate(library.materials):
        parameters, gains = allowed(found, material, count, rng)
        true = gains[:, None, None] * shown(material, parameters, at)
        std = np.broadcast_to(noise * true[:, :1], true.shape)
        for reading, own in zip(true + std * rng.standard_normal(true.shape), std, strict=True):
            joined = {n: np.append(getattr(data, n), getattr(at, n)) for n in ("theta_i", "theta_r", "phi")}
            batch.append(
                replace(
                    data,
                    **joined,
                    values=np.concatenate([data.values, reading], axis=1),
                    std=np.concatenate([data.std, own], axis=1),
                    group=None,
                    scale=None,
                )
            )
            truth.append(c)
    judged = evidence(library.materials, batch, gain=found.gain)
    after = probabilities(judged.log_evidence)
    inside = nominal(judged.distance, judged.degrees_of_freedom) > 1.0 - found.confidence
    own_class = np.array(truth)
    weight = p[own_class] / count
    grown = np.log2(after[np.arange(len(truth)), own_class] / p[own_class])
    bits = float((weight * grown).sum())
    error = float(np.sqrt((weight**2 * (grown - bits) ** 2).sum()))
    right = float((weight * (after.argmax(axis=1) == own_class)).sum())
    return bits, error, right, float((weight * inside.sum(axis=1)).sum())


def main() -> int:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--specimens", type=int, default=1000, help="of each candidate")
    options = parser.parse_args()
    bundled = bundled_library()
    print(
        "| data so far, noise | candidates (probability) | next at θ_i / θ_r | bits: expected | simulated "
        "| right: expected | simulated | left: expected | simulated |"
    )
    print("| --- " * 9 + "|")
    for paint, angles, noise, gain, names in CASES:
        library = Library(tuple(bundled[name] for name in names))
        data = measured(paint, angles, noise)
        one = pbrdf.make_dataset(
            data.theta_i, data.theta_r, data.phi, quantity="brdf", **dict(zip("IQU", data.values, strict=True)),
            std=dict(zip("IQU", data.std, strict=True)),
        )  # fmt: skip
        found = identify(one, library, gain=gain)
        best = pbrdf.next_measurement(found, noise=noise).geometries
        first = tuple(float(np.degrees(a[0])) for a in (best.theta_i, best.theta_r, best.phi))
        chosen = [first, *((*pair, 0.0) for pair in OTHERS)]
        words = f"{len(angles)} reading{'s' * (len(angles) > 1)}, {100 * noise:g} %, gain {'un' * gain}known"
        told_apart = ", ".join(f"{c.name} ({c.probability:.2f})" for c in found.candidates)
        for number, place in enumerate(chosen):
            expected = pbrdf.next_measurement(found, tuple(np.radians(np.array(place))), noise=noise)
            bits, error, right, left = told(found, library, place, noise, options.specimens)
            at = f"{place[0]:.3g}° / {place[1]:.3g}°" + (f", φ {place[2]:g}°" if place[2] else "")
            at += " (the best)" * (number == 0)
            print(
                f"| {words} | {told_apart} | {at} | {expected.information[0]:.2f} | {bits:.2f} ± {error:.2f} "
                f"| {100 * expected.expected_right[0]:.0f} % | {100 * right:.0f} % "
                f"| {expected.expected_left[0]:.2f} | {left:.2f} |",
                flush=True,
            )
            words = told_apart = ""
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
