"""Make the oracle of ``pbrdf.convert``: Mueller matrices as other programs give them, in their own conventions.

Elements are polarisers and retarders at an angle, reflections are off a bare flat surface. Rough surfaces are seen out
of the plane of incidence: ``theta_r``, ``azimuth`` of the viewer less that of the source; where only Stokes vectors are
known, they stand in the first column. Angles are degrees, the index is n − iκ whatever the program wants.

Run from the repository's root with the names of programs, each in an environment that holds it at the version named
below: ``python scripts/make_convention_numbers.py katsu pypolar``. The rows of the others stay as they are.
"""

from __future__ import annotations

import csv
import importlib.metadata
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

TARGET = Path(__file__).parents[1] / "tests" / "data_oracle" / "conventions.csv"
VERSIONS = {
    "katsu": "0.1.0",
    "polanalyser": "3.0.0",
    "pypolar": "1.2.0",
    "pyElli": "0.23.1",
    "pySCATMECH": "0.1.10",
    "mitsuba": "3.9.1",
    "eradiate-mitsuba": "0.5.0",
    "eradiate": "1.2.0",
}
COLUMNS = ["program", "version", "what", "angle", "retardance", "n", "kappa", "R", "theta_r", "azimuth"]
ELEMENTS = [f"m{i}{j}" for i in range(4) for j in range(4)]
#: Angle and retardance in degrees: no symmetry, both signs, more than half a turn.
RETARDERS = ((20.0, 50.0), (-35.0, 90.0), (70.0, 250.0))
POLARISERS = (20.0, -35.0, 100.0)
#: Angle of incidence in degrees, n, κ: gold on both sides of the principal angle, an absorber, glass on both sides of
#: Brewster's angle.
SURFACES = (
    (30.0, 0.47, 2.83),
    (70.0, 0.47, 2.83),
    (75.0, 0.47, 2.83),
    (60.0, 1.5, 0.5),
    (40.0, 1.5, 0.0),
    (70.0, 1.5, 0.0),
)
#: θ_i, θ_r, azimuth of the viewer less that of the source, degrees: both sides of the plane, forward and back.
VIEWS = (
    (35.0, 40.0, 180.0),
    (35.0, 20.0, 200.0),
    (35.0, 50.0, 150.0),
    (60.0, 50.0, -110.0),
    (25.0, 30.0, 40.0),
)
#: n, κ of rough surfaces: water, and a metal, whose light shows the sign of V.
WATER, METAL = (1.33, 0.0), (1.5, 2.0)
#: What, angle, retardance, n, κ, R, θ_r, azimuth, matrix.
Row = tuple[str, Any, Any, Any, Any, Any, Any, Any, np.ndarray]


def elements(polariser: Any, retarder: Any) -> Iterator[Row]:
    """Rows of the elements of functions of the angle, and of angle and retardance, in radians."""
    for angle in POLARISERS:
        yield "polariser", angle, *[""] * 6, polariser(np.deg2rad(angle))
    for angle, retardance in RETARDERS:
        yield "retarder", angle, retardance, *[""] * 5, retarder(np.deg2rad(angle), np.deg2rad(retardance))


def katsu() -> Iterator[Row]:
    """Its elements."""
    from katsu import mueller

    yield from elements(mueller.linear_polarizer, mueller.linear_retarder)


def polanalyser() -> Iterator[Row]:
    """Its elements."""
    import polanalyser

    yield from elements(polanalyser.polarizer, lambda angle, delta: polanalyser.retarder(delta, angle))


def pypolar() -> Iterator[Row]:
    """Its elements, and its reflection of Mueller matrices, which wants n − iκ."""
    from pypolar import mueller

    yield from elements(mueller.op_linear_polarizer, mueller.op_retarder)
    for angle, n, kappa in SURFACES:
        matrix = mueller.op_fresnel_reflection(complex(n, -kappa), np.deg2rad(angle))
        yield "reflection", angle, "", n, kappa, "", "", "", matrix


def pyelli() -> Iterator[Row]:
    """Its reflection, which wants n + iκ and divides by M00, and its reflectance."""
    import elli

    for angle, n, kappa in SURFACES:
        medium = elli.IsotropicMaterial(elli.ConstantRefractiveIndex(n=complex(n, kappa)))
        result = elli.Structure(elli.AIR, [], medium).evaluate(np.array([500.0]), angle)
        yield "reflection", angle, "", n, kappa, float(result.R[0]), "", "", result.mueller_matrix[0]


def pyscatmech() -> Iterator[Row]:
    """Its elements; ``MuellerPolarizer`` takes the least transmittance, 0 by default."""
    from pySCATMECH.mueller import MuellerPolarizer, MuellerRetarder

    yield from elements(
        lambda angle: MuellerPolarizer(angle=angle),
        lambda angle, delta: MuellerRetarder(phase=delta, angle=angle),
    )


def mitsuba() -> Iterator[Row]:
    """Its functions of Mueller matrices, single precision; x is s of the surface."""
    import mitsuba as mi

    mi.set_variant("scalar_spectral_polarized")
    m = mi.mueller
    yield from elements(
        lambda angle: m.rotated_element(angle, m.linear_polarizer()),
        lambda angle, delta: m.rotated_element(angle, m.linear_retarder(delta)),
    )
    for angle, n, kappa in SURFACES:
        matrix = m.specular_reflection(np.cos(np.deg2rad(angle)), mi.Complex2f(n, kappa))
        yield "reflection", angle, "", n, kappa, "", "", "", matrix


def eradiate_mitsuba() -> Iterator[Row]:
    """Its kernel in double precision: elements, Mitsuba's rough conductor, and the sea, a surface of its own.

    Matrices of surfaces are turned to the frames of the integrator's ``meridian_align``, x = (ẑ×k)×k.
    """
    import mitsuba as mi

    mi.set_variant("scalar_mono_polarized_double")
    m = mi.mueller
    yield from elements(
        lambda angle: m.rotated_element(angle, m.linear_polarizer()),
        lambda angle, delta: m.rotated_element(angle, m.linear_retarder(delta)),
    )
    n, kappa = METAL
    surfaces = {
        "facets": {"type": "roughconductor", "distribution": "beckmann", "alpha": 0.3, "eta": n, "k": kappa},
        "sea": {"type": "ocean_mishchenko", "wind_speed": 10.0, "eta": n, "k": kappa, "ext_ior": 1.0},
    }
    for what, description in surfaces.items():
        surface = mi.load_dict(description)
        for theta_i, theta_r, azimuth in VIEWS:
            si = mi.SurfaceInteraction3f()
            si.wi, si.uv = mi.Vector3f(*towards(theta_r, azimuth)), mi.Point2f(0.5, 0.5)
            source = mi.Vector3f(*towards(theta_i, 0.0))
            frames = []
            for k in (-source, si.wi):
                frames += [k, m.stokes_basis(k), mi.Vector3f(*meridian(np.array(k).ravel()))]
            matrix = m.rotate_mueller_basis(surface.eval(mi.BSDFContext(), si, source), *frames)
            values = np.array([[np.ravel(matrix[i, j])[0] for j in range(4)] for i in range(4)])
            yield what, theta_i, "", n, kappa, "", theta_r, azimuth, values


def eradiate() -> Iterator[Row]:
    """What it renders of a matt ground and of the sea under a sun, natural and behind a right circular plate.

    ``radiance`` over ``irradiance``; the integrator's ``meridian_align`` is on by default. R is ``brf``.
    """
    import eradiate
    import mitsuba as mi

    eradiate.set_mode("mono_polarized_double")
    metre, degree, nanometre = (eradiate.unit_registry(name) for name in ("m", "degree", "nm"))
    n, kappa = WATER
    ground = {
        "type": "lambertian",
        "reflectance": {"type": "uniform", "value": 0.3, "quantity": "reflectance"},
    }
    sea = {"type": "ocean_mishchenko", "wind_speed": 10.0, "eta": n, "k": kappa, "ext_ior": 1.0}
    sun_azimuth = 30.0
    for what, surface in (("matt", ground), ("sea natural", sea), ("sea circular", sea)):
        for theta_i, theta_r, azimuth in VIEWS:
            sun = 100.0 * towards(theta_i, sun_azimuth)
            place = mi.ScalarTransform4f().look_at(
                origin=sun.tolist(), target=[0.0, 0.0, 0.0], up=[0.0, 0.0, 1.0]
            )
            plate = {
                "type": "rectangle",
                "to_world": place @ mi.ScalarTransform4f().scale(5.0),
                "bsdf": {"type": "circular", "left_handed": False},
            }
            found = eradiate.run(
                eradiate.experiments.AtmosphereExperiment(
                    geometry={
                        "type": "plane_parallel",
                        "toa_altitude": 1000.0 * metre,
                        "ground_altitude": 0.0 * metre,
                    },
                    atmosphere=None,
                    surface=surface,
                    illumination={
                        "type": "directional",
                        "zenith": theta_i * degree,
                        "azimuth": sun_azimuth * degree,
                        "irradiance": {"type": "uniform", "value": 2.0, "quantity": "irradiance"},
                    },
                    measures={
                        "type": "mdistant",
                        "construct": "from_angles",
                        "angles": [[theta_r, sun_azimuth + azimuth]] * degree,
                        "target": [0.0, 0.0, 0.0],
                        "spp": 1,
                        "srf": {"type": "delta", "wavelengths": 550.0 * nanometre},
                    },
                    integrator={"type": "volpath", "stokes": True},
                    kdict={"plate": plate} if what == "sea circular" else {},
                )
            )
            matrix = np.full((4, 4), np.nan)
            matrix[:, 0] = found["radiance"].values.ravel() / found["irradiance"].values.ravel()
            known = ("", "") if what == "matt" else WATER
            yield what, theta_i, "", *known, float(found["brf"].values.item()), theta_r, azimuth, matrix


def towards(zenith: float, azimuth: float) -> np.ndarray:
    """Unit vector of angles in degrees."""
    theta, phi = np.deg2rad(zenith), np.deg2rad(azimuth)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def meridian(k: np.ndarray) -> np.ndarray:
    """Eradiate's x axis of light that travels along k."""
    x: np.ndarray = np.cross(np.cross([0.0, 0.0, 1.0], k), k)
    return x / np.linalg.norm(x)


ROWS = {
    "katsu": katsu,
    "polanalyser": polanalyser,
    "pypolar": pypolar,
    "pyElli": pyelli,
    "pySCATMECH": pyscatmech,
    "mitsuba": mitsuba,
    "eradiate-mitsuba": eradiate_mitsuba,
    "eradiate": eradiate,
}


def main(programs: list[str]) -> None:
    """Write the rows of the named programs anew."""
    rows = []
    if TARGET.exists():
        with TARGET.open(newline="", encoding="utf-8") as file:
            rows = [row for row in list(csv.reader(file))[1:] if row[0] not in programs]
    for program in programs:
        version = importlib.metadata.version(program)
        if version != VERSIONS[program]:
            raise SystemExit(f"{program} {VERSIONS[program]} is wanted, {version} is here")
        for *known, matrix in ROWS[program]():
            values = np.asarray(matrix, dtype=float).ravel() + 0.0
            rows.append(
                [program, version, *map(str, known), *("" if np.isnan(x) else f"{x:.15g}" for x in values)]
            )
    rows.sort(key=lambda row: list(VERSIONS).index(row[0]))
    with TARGET.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([[*COLUMNS, *ELEMENTS], *rows])


if __name__ == "__main__":
    main(sys.argv[1:])
