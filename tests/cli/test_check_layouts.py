"""``pbrdf check`` of tables in the layouts of strangers."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("data.csv", "# theta_i, theta_r, phi, brdf\n30,20,0,0.3\n30,30,0,0.5\n"),
        ("data.dat", "theta_i theta_r phi brdf\n30 20 0 0.3\n30 30 0 0.5\n"),
        ("data.csv", "theta_i,theta_r,phi,brdf\ndeg,deg,deg,1/sr\n30,20,0,0.3\n30,30,0,0.5\n"),
        ("data.asc", "Lamp 3\n\ntheta_i;theta_r;phi;brdf\n30;20;0;0,3\n30;30;0;0,5\n"),
    ],
)
def test_layouts_of_strangers(run, tmp_path, name, text):
    (tmp_path / name).write_text(text)
    told = run("check", name).stdout
    assert "2 geometries" in told
    assert "30°" in told
    assert "BRDF, 1/sr" in told
    assert ("'Lamp 3'" in told) == text.startswith("Lamp")


def test_numbers_without_names(refused, tmp_path):
    (tmp_path / "data.txt").write_text("30 20 0 0.3\n")
    assert "line 1: numbers stand here, but no line above them has the 4 names" in refused(
        "check", "data.txt"
    )


def test_a_sheet_of_a_text(refused, tmp_path):
    (tmp_path / "data.csv").write_text("theta_i,theta_r,brdf\n30,20,0.3\n")
    assert "this is a text, which has no sheets" in refused("check", "data.csv", "--sheet", "A")
