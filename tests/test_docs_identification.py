"""The example of the page on identification runs and comes out as it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "identification.md"


@pytest.mark.slow
def test_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    namespace: dict = {"__name__": "page"}
    exec(compile(block, str(PAGE), "exec"), namespace)
    assert namespace["found"].materials == ["grey"]
    assert capsys.readouterr().out.endswith("True\n")
