"""Shared fixtures: the two computed tables, Dr.Jit arrays, and a deterministic Hypothesis profile."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

import pbrdf  # noqa: F401  before any test imports drjit: it tells Dr.Jit where LLVM is
from pbrdf.models import MODELS

# examples are drawn the same way every time; HYPOTHESIS_PROFILE=explore draws new ones and more of them
settings.register_profile("suite", deadline=None, derandomize=True, database=None, max_examples=15)
settings.register_profile(
    "explore", deadline=None, max_examples=300, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

ORACLE = Path(__file__).parent / "data_oracle"
SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"


def read_oracle(name: str) -> dict[str, np.ndarray]:
    """Columns of a table by name; the Mueller matrices as ``M`` of shape (rows, 4, 4)."""
    with (ORACLE / name).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    words = ("normalization", "transmittance", "distribution")
    table = {
        key: np.array([row[key] if key in words else float(row[key]) for row in rows]) for key in rows[0]
    }
    elements = [table.pop(f"f{i}{j}") for i in range(4) for j in range(4)]
    table["M"] = np.stack(elements, -1).reshape(-1, 4, 4)
    return table


@pytest.fixture(scope="session")
def scatmech_table():
    """300 specular Mueller matrices computed with NIST SCATMECH, turned to our convention."""
    return read_oracle("specular_scatmech.csv")


@pytest.fixture(scope="session")
def double_gauss_table():
    """240 rows: 120 whole-model Mueller matrices in both readings."""
    return read_oracle("double_gauss.csv")


@pytest.fixture(scope="session")
def pplastic_table():
    """100 Mueller matrices of Mitsuba's ``pplastic``, turned to our convention."""
    return read_oracle("pplastic_mitsuba.csv")


@pytest.fixture(scope="session")
def subsurface_table():
    """72 Mueller matrices of SCATMECH's subsurface scattering, turned to our convention."""
    return read_oracle("subsurface_scatmech.csv")


@pytest.fixture(scope="session")
def rpv_table():
    """60 Mueller matrices of eradiate's ``rpv``, turned to our convention."""
    return read_oracle("rpv_eradiate.csv")


@pytest.fixture(scope="session")
def maignan_table():
    """40 Mueller matrices of eradiate's ``maignan``, turned to our convention and to a BRDF."""
    return read_oracle("maignan_eradiate.csv")


@pytest.fixture(scope="session")
def roughconductor_table():
    """100 Mueller matrices of Mitsuba's ``roughconductor``, turned to our convention."""
    return read_oracle("roughconductor_mitsuba.csv")


@pytest.fixture(scope="session")
def jit():
    """Turn numbers or arrays into the active backend's float64 Dr.Jit array."""
    from pbrdf.backend import get_backend

    backend = get_backend()
    # a copy of its own: the alignment of NumPy's memory would be part of the kernel, which is compiled anew for each
    return lambda x: backend.upload(backend.Float, np.atleast_1d(np.asarray(x, dtype=float)))


@pytest.fixture(scope="session")
def plain():
    """Turn nested tuples and lists of Dr.Jit floats into NumPy arrays, the tuple index first."""

    def convert(x, size):
        if isinstance(x, tuple | list):
            return np.stack([convert(v, size) for v in x])
        x = np.asarray(x.numpy() if hasattr(x, "numpy") else x, dtype=float)
        return np.broadcast_to(x, (size,)).copy() if x.size == 1 else x

    return convert


@pytest.fixture(scope="session")
def measured():
    """Path of a measured file that is not part of the repository; skips where it is absent."""

    def find(name: str) -> Path:
        path = SHARED / name
        if not path.is_file():
            pytest.skip(f"measured data absent: ../shared/data/{name} (not part of the repository)")
        return path

    return find


@pytest.fixture(autouse=True)
def models_as_before():
    """A model that a test registers is known to that test alone."""
    before = dict(MODELS._classes)
    yield
    MODELS._classes.clear()
    MODELS._classes.update(before)
