"""Make the bundled virtual experiment: five paints, three camera positions, 21 sample angles each.

A virtual run of the protocol of Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017):
the bistatic angle Ψ between source and camera is fixed for each camera position and the sample is turned, so
that θ_i = Ψ/2 − δ and θ_r = Ψ/2 + δ in the plane of incidence. The paper gives neither the three Ψ nor the
21 angles; here Ψ = 60°, 80°, 100°, and the offsets δ crowd towards the mirror direction, δ = ±L (j/10)²,
because the lobe of the smoothest paint is only 0.7° wide. Noise: 1 % of the intensity on I, Q, U and 5 % on V
(the accuracy that the paper states for its imager), normal, with a fixed seed.

Run from the repository's root: ``python scripts/make_bundled_experiment.py``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbrdf.data import make_dataset, write
from pbrdf.data.paints import PAINTS, WAVELENGTH, load_paint
from pbrdf.instruments.goniometer.protocols import Protocol

NOISE = {"I": 0.01, "Q": 0.01, "U": 0.01, "V": 0.05}  # relative to I
SEED = 20171102
TARGET = Path(__file__).parents[1] / "src" / "pbrdf" / "data" / "experiment"


def main() -> None:
    """Write one CSV file a paint."""
    protocol = Protocol.in_plane()
    angles = protocol.theta_i, protocol.theta_r, protocol.phi
    rng = np.random.default_rng(SEED)
    TARGET.mkdir(exist_ok=True)
    for name in PAINTS:
        stokes = load_paint(name).stokes(*angles)
        std = {channel: share * stokes[:, 0] for channel, share in NOISE.items()}
        noisy = {c: stokes[:, i] + std[c] * rng.standard_normal(len(protocol)) for i, c in enumerate("IQUV")}
        ds = make_dataset(
            *angles,
            quantity="brdf",
            **noisy,
            std=std,
            wavelength=WAVELENGTH,
            group=protocol.group,
            simulated=True,
            attrs={
                "scale": "arbitrary",  # Table 1 is on a camera's scale, see pbrdf.data.paints
                "title": f"Virtual pBRDF measurement of the paint {name}",
                "source": "SIMULATED with the double-Gauss model, scripts/make_bundled_experiment.py",
                "reference": "parameters: Zhang, Song, Zhao, Infrared and Laser Engineering 46(11), 1117002 (2017)",
            },
        )
        write(ds, TARGET / f"{name}.csv")


if __name__ == "__main__":
    main()
