"""Outlines of the paints are what their models say."""

import numpy as np

import pbrdf
from pbrdf.data.paints import PAINTS
from pbrdf.explorer import previews


def test_outlines_rank_the_paints_as_their_models_do():
    emitted = []
    previews.answer({"id": 4}, [], None, lambda content, buffers: emitted.append(content))
    [content] = emitted
    assert len(content["outlines"]) == len(PAINTS)
    k = 133  # the mirror direction
    assert content["views"][k] == content["theta_i"]
    bright = [outline["intensity"][k] for outline in content["outlines"]]
    polarised = [outline["dolp"][20] for outline in content["outlines"]]
    for name, one, other in zip(PAINTS, bright, polarised, strict=True):
        model = pbrdf.load_paint(name)
        S = model.stokes(np.deg2rad(45.0), np.deg2rad([45.0, 68.0]), np.array([0.0, np.pi]))
        top = pbrdf.load_paint("white").stokes(np.deg2rad(45.0), np.deg2rad(45.0), 0.0)[0]
        np.testing.assert_allclose(one, 1.0 + np.log10(S[0, 0] / top) / 6.0, atol=2e-3)
        assert 0.0 <= other <= 1.0
    assert max(max(outline["dolp"]) for outline in content["outlines"]) == 1.0
