"""The page opens and shows a model."""

import pytest

from pbrdf.explorer.workspace import Workspace

pytestmark = pytest.mark.slow


def test_a_model_is_shown(served, page, white):
    page.goto(served(lambda: Workspace([("white", white)])))
    page.wait_for_selector("canvas")
    assert page.locator("input[type=range][name=sigma]").count() == 1
