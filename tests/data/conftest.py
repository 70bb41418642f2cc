"""Fixtures of the data tests."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture
def measured():
    """Path of a measured file that is not part of the repository; skips where it is absent."""

    def find(name: str) -> Path:
        path = SHARED / name
        if not path.is_file():
            pytest.skip(f"measured data absent: ../shared/data/{name} (not part of the repository)")
        return path

    return find


@pytest.fixture
def text_file(tmp_path):
    """Write text to a file of the given name and return its path."""

    def write(text: str, name: str = "data.csv") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8", newline="")
        return path

    return write
