#!/usr/bin/env bash
# Library:   lmfit 1.3.4, Minimizer with the methods leastsq and least_squares.
# Guess:     with a parameter on its bound both methods give the other parameters the standard errors of a fit in which
#            that parameter is held there.
# Behaviour: leastsq gives no standard error to any parameter (errorbars False, success True); least_squares gives
#            errors as if the bound were not there: one to the parameter on it, larger ones to those correlated with it.
# Seen:      leastsq none; least_squares b +- 0.0620, c +- 0.0180 on its bound; c held: b +- 0.0385
# Exit:      0 while the behaviour stands, 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check lmfit==1.3.4 scipy==1.17.1 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import lmfit
import numpy as np

x = np.linspace(0.0, 3.0, 31)
# the best offset c is -0.1, below its bound
y = 2.0 * np.exp(-1.3 * x) - 0.1 + 0.02 * np.sin(17.0 * x)


def fitted(method, vary=True):
    parameters = lmfit.create_params(
        a={"value": 1.0}, b={"value": 1.0}, c={"value": 0.1 if vary else 0.0, "min": 0.0, "vary": vary}
    )
    return lmfit.minimize(lambda p: p["a"] * np.exp(-p["b"] * x) + p["c"] - y, parameters, method=method)


transformed, trusted, held = fitted("leastsq"), fitted("least_squares"), fitted("least_squares", vary=False)
errors = {name: p.stderr for name, p in trusted.params.items()}
none = transformed.success and all(p.stderr is None for p in transformed.params.values())
print(f"leastsq {'none' if none else 'some'}; least_squares b +- {errors['b']:.4f}, c +- {errors['c']:.4f} on its "
      f"bound; c held: b +- {held.params['b'].stderr:.4f}")
stands = none and trusted.params["c"].value < 1e-9 and errors["c"] > 0.01
stands = stands and abs(trusted.params["b"].value - held.params["b"].value) < 1e-4
raise SystemExit(0 if stands and errors["b"] > 1.5 * held.params["b"].stderr else 1)
PYTHON
