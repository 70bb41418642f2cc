"""Running the command line within this process."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from pbrdf.cli.main import app


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a command in an empty folder; returns the result, whose output and error streams are apart."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "110")

    def command(*arguments, code=0):
        result = CliRunner().invoke(app, [str(a) for a in arguments])
        assert result.exit_code == code, result.output
        if code == 0 and result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    return command


@pytest.fixture
def refused(run, tmp_path):
    """Run a command that must be refused: one line on standard error, exit code 2, and no file made."""

    def files():
        # Python keeps the bytecode of a model of the user's own beside it
        return {path for path in tmp_path.rglob("*") if "__pycache__" not in path.parts}

    def command(*arguments):
        before = files()
        result = run(*arguments, code=2)
        assert files() == before
        assert result.stdout == ""
        assert result.stderr.startswith("pbrdf: error: ")
        assert result.stderr.count("\n") == 1
        assert "Traceback" not in result.output
        return result.stderr.removeprefix("pbrdf: error: ").rstrip("\n")

    return command
