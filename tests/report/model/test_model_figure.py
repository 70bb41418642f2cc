import numpy as np
import pytest
from figure_helpers import lines

import pbrdf
from pbrdf.errors import ModelError
from pbrdf.report.model.figure import model_figure


def test_a_model_is_drawn_over_the_hemisphere_and_in_plane():
    paint = pbrdf.load_paint("cd-back")
    figure = model_figure(paint, 35.0, "cd-back")
    plane, polarisation = figure.axes[2:4]
    assert {line.get_label() for line in plane.get_lines()} >= {"total", "specular", "diffuse"}
    total = lines(plane, "total")[0]
    at = int(np.argmin(np.abs(total.get_xdata() - 35.0)))
    assert total.get_ydata()[at] == pytest.approx(paint.stokes(np.deg2rad(35.0), np.deg2rad(35.0))[0])
    signed = lines(polarisation, "total")[0].get_ydata()
    assert signed.min() < -0.1 < 0.05 < signed.max()
    assert [ax.name for ax in figure.axes[:2]] == ["polar", "polar"]
    assert "35°" in figure.get_suptitle()


def test_a_figure_of_a_model_needs_one_model_and_an_angle():
    paint = pbrdf.load_paint("cd-back")
    with pytest.raises(ModelError, match="must be at least 0"):
        model_figure(paint, 90.0, "x")
    with pytest.raises(ModelError, match="arrays"):
        model_figure(paint.replace(n=np.array([1.5, 1.6])), 30.0, "map")
