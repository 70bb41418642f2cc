"""Random evaluations over the whole documented domain: nothing undefined, nothing negative, all of it realisable.

    python benchmarks/domain.py [--count N] [--seed S] [--model NAME …] [--single]

For every registered model Mueller matrices are evaluated (float64; ``--single``: float32 from vectors, times cosθ_r,
as the renderer does) for random directions and parameters, each of its own: parameters over the whole range that a
model takes, their ends included (where that range is open, and with ``--single``, the fit's bounds), directions also
within 1e-12 of the normal, the horizon, the mirror direction and backscatter, and azimuths of many turns. Counted are
matrices that hold a NaN or an infinity, negative reflectances, and matrices whose coherency matrix has an eigenvalue
below −1e-12 f00 (float32: −1e-5), which no passive surface has. The script ends with status 1 if there is any, and
prints the first of each kind.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from typing import Any

import drjit as dr
import numpy as np
from rich.console import Console
from rich.table import Table

from pbrdf.backend import get_backend
from pbrdf.errors import ModelError
from pbrdf.models import MODELS
from pbrdf.models.base import Model
from pbrdf.optics.mueller import coherency_eigenvalues
from pbrdf.rendering.reference_planes import light_path

BATCH = 1 << 16
#: Directions with cosθ up to this are below the renderer's horizon.
HORIZON = 1e-6
#: Eigenvalues in units of f00 down to minus this are rounding, by precision.
TINY = {False: 1e-290, True: 1e-30}
ROUNDING = {False: 1e-12, True: 1e-5}


def directions(rng: np.random.Generator, size: int) -> dict[str, np.ndarray]:
    """Angles in radians, dense at the corners of the domain."""

    def zenith() -> np.ndarray:
        kinds = rng.integers(0, 8, size)
        near = 10.0 ** rng.uniform(-12.0, 0.0, size)
        return np.select(
            [kinds == 0, kinds == 1, kinds == 2, kinds == 3],
            [near, 0.5 * math.pi - near, np.zeros(size), np.full(size, 0.5 * math.pi)],
            np.arccos(rng.random(size)),
        )

    theta_i, theta_r = zenith(), zenith()
    kinds = rng.integers(0, 8, size)
    near = 10.0 ** rng.uniform(-12.0, 0.0, size)
    same = rng.integers(0, 6, size) == 0
    theta_r = np.where(same, np.clip(theta_i + near * rng.integers(-1, 2, size), 0.0, 0.5 * math.pi), theta_r)
    phi = np.select(
        [kinds == 0, kinds == 1, kinds == 2, kinds == 3, kinds == 4],
        [near, math.pi - near, np.zeros(size), np.full(size, math.pi), 10.0 ** rng.uniform(0.0, 38.0, size)],
        rng.uniform(-2.0 * math.pi, 2.0 * math.pi, size),
    )
    return {"theta_i": theta_i, "theta_r": theta_r, "phi": phi}


def parameters(cls: type[Model], rng: np.random.Generator, size: int, fitted: bool) -> dict[str, np.ndarray]:
    """Values of the parameters over their whole ranges, one in eight at an end."""
    values = {}
    for p in cls.parameters:
        lower, upper = (p.lower, p.upper) if fitted else p.domain
        lower = lower if math.isfinite(lower) else p.lower
        upper = upper if math.isfinite(upper) else p.upper
        share = rng.random(size)
        kinds = rng.integers(0, 16, size)
        if p.logarithmic and lower > 0.0:
            inside = lower * (upper / lower) ** share
        else:
            inside = lower + (upper - lower) * share
        values[p.name] = np.select(
            [kinds == 0, kinds == 1], [np.full(size, lower), np.full(size, upper)], inside
        )
    return values


def choices(cls: type[Model]) -> Iterator[dict[str, str]]:
    """The options of a model as they stand, then each other choice by itself; ``high`` would take hours."""
    yield {}
    for name, option in cls.options.items():
        yield from ({name: choice} for choice in option[1:] if choice != "high")


def evaluate(model: Model, angles: dict[str, np.ndarray], single: bool) -> np.ndarray:
    """Mueller matrices, shape (N, 4, 4)."""
    return renderer_values(model, angles) if single else np.asarray(model.mueller(**angles))


def renderer_values(model: Model, angles: dict[str, np.ndarray]) -> np.ndarray:
    """BRDF times cosθ_r in float32 from vectors, as the Mitsuba plugin evaluates it."""
    Float: Any = dr.float32_array_t(get_backend().Float)

    def vector(theta: np.ndarray, azimuth: np.ndarray) -> list[Any]:
        parts = np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)
        return [Float(part.astype(np.float32)) for part in parts]

    rng = np.random.default_rng(0)
    azimuth = rng.uniform(-math.pi, math.pi, len(angles["phi"]))
    omega_i = vector(angles["theta_i"], azimuth + math.pi)
    omega_r = vector(angles["theta_r"], azimuth + angles["phi"])
    above = (omega_i[2] > HORIZON) & (omega_r[2] > HORIZON)
    omega_i, omega_r = (
        [dr.select(above, x, n) for x, n in zip(o, (0.0, 0.0, 1.0), strict=True)] for o in (omega_i, omega_r)
    )
    values = {name: Float(value.astype(np.float32)) for name, value in model.values.items()}
    f = model.kernel(light_path(omega_i, omega_r).geometry, values)
    out = [dr.select(above, Float(x) * omega_r[2], 0.0) for row in f for x in row]
    dr.eval(out)
    return np.stack([np.broadcast_to(x.numpy(), len(azimuth)) for x in out], axis=-1).reshape(-1, 4, 4)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000_000, help="evaluations, all models together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--model", action="append", choices=[*MODELS], help="of these models only")
    parser.add_argument("--single", action="store_true", help="in float32, within the bounds of a fit")
    options = parser.parse_args()
    chosen = [
        (cls, choice) for name in options.model or MODELS for cls in [MODELS[name]] for choice in choices(cls)
    ]
    console = Console()
    table = Table(title="random evaluations over the whole domain", title_justify="left")
    for column in ("model", "evaluations", "undefined", "negative", "not realisable", "least eigenvalue"):
        table.add_column(column, justify="left" if column == "model" else "right")
    failed, examples = False, []
    each = max(options.count // len(chosen), 1)
    for cls, choice in chosen:
        rng = np.random.default_rng(options.seed)
        counts, least = np.zeros(3, dtype=int), math.inf
        done = 0
        while done < each:
            size = min(BATCH, each - done)
            done += size
            angles, values = directions(rng, size), parameters(cls, rng, size, options.single)
            if choice.get("normalization") == "visible":
                values["k"] = np.maximum(values["k"], 0.35)
            for p in cls.parameters:
                if p.extinction_of:
                    values[p.extinction_of] = np.where(
                        values[p.name] == 0.0,
                        np.maximum(values[p.extinction_of], 1.0),
                        values[p.extinction_of],
                    )
            try:
                f = evaluate(cls.from_values(values, **choice), angles, options.single)
            except ModelError as error:
                console.print(f"{cls.name}: {error}", style="red")
                failed = True
                break
            defined = np.isfinite(f).all(axis=(1, 2))
            f00 = f[:, 0, 0]
            scaled = np.where(defined[:, None, None], f, 0.0)
            # of numbers near the end of the range of floating-point numbers only few digits are left
            scaled = scaled / np.maximum(np.where(defined, f00, 0.0), TINY[options.single])[:, None, None]
            eigenvalues = coherency_eigenvalues(scaled)[:, 0]
            for kind, bad in enumerate((~defined, f00 < 0.0, eigenvalues < -ROUNDING[options.single])):
                counts[kind] += int(bad.sum())
                if bad.any():
                    at = int(np.argmax(bad))
                    examples.append(
                        (kind, cls.name, choice, {k: v[at] for k, v in (angles | values).items()}, f[at])
                    )
            least = min(least, float(eigenvalues.min()))
        failed |= bool(counts.any())
        name = " ".join([cls.name, *choice.values()])
        table.add_row(name, f"{done:,}", *(str(c) if c else "–" for c in counts), f"{least:.1e}")
    console.print(table)
    seen = set()
    for kind, name, choice, where, f in examples:
        if (kind, name, tuple(choice.values())) not in seen:
            seen.add((kind, name, tuple(choice.values())))
            what = ("undefined", "negative", "not realisable")[kind]
            numbers = {k: float(v) for k, v in where.items()}
            console.print(f"{what}: {name} {choice} {numbers}\n{f}", highlight=False, markup=False)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
