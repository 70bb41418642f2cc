"""Mitsuba for the tests of scenes; they are skipped without it."""

from __future__ import annotations

import pytest


@pytest.fixture
def mitsuba():
    """Mitsuba's module with the default variant active and the plugins registered."""
    pytest.importorskip("mitsuba", reason="rendering needs mitsuba: pip install 'mitsuba>=3.9'")
    from pbrdf.rendering.variant import start_mitsuba

    return start_mitsuba()
