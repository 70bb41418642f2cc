"""The page on a model of one's own runs, block after block, and its class is short."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pbrdf.models import MODELS

PAGE = Path(__file__).parents[1] / "docs" / "own-model.md"


@pytest.mark.slow
def test_the_page_runs(tmp_path, monkeypatch, capsys):
    MODELS._classes.pop("lambert-ggx", None)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 2
    namespace: dict = {"__name__": "page"}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), namespace)
    assert blocks[0].count("\n") <= 45
    assert namespace["result"].estimates["alpha"].value == pytest.approx(0.1, rel=1e-3)
    assert "lambert-ggx" in capsys.readouterr().out
    assert (tmp_path / "paint-fit" / "fit.nc").is_file()
