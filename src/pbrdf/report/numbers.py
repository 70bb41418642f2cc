"""Numbers as a person reads them: values rounded by their error, per cent, lists of wavelengths."""

from __future__ import annotations

import math

__all__ = ["brief", "per_cent", "plain", "with_error"]

#: Error, relative to the value, below which the value is as good as exact: simulated data without noise.
_EXACT = 1e-9
#: Decimal places beyond which a power of ten is easier to read.
_MOST_DECIMALS = 7


def with_error(value: float, error: float) -> str:
    """Value and standard error with two significant digits of the error, ``0.03978 ± 0.00012``.

    Parameters
    ----------
    value
        The value.
    error
        Its standard error, > 0; NaN or 0 gives the value alone.
    """
    if not (math.isfinite(value) and math.isfinite(error) and error > 0.0):
        return brief(value)
    if error < _EXACT * abs(value):
        return f"{value:.10g} ± {error:.1e}".replace("-", "−")
    # Rounding first: 0.0996 is 0.10 to two digits, not 0.100.
    exponent = math.floor(math.log10(float(f"{error:.1e}")))
    decimals = 1 - exponent
    if decimals > _MOST_DECIMALS or exponent > 5:
        power = max(math.floor(math.log10(abs(value))) if value else exponent, exponent)
        digits = max(power - exponent + 1, 0)
        return f"({value / 10.0**power:.{digits}f} ± {error / 10.0**power:.{digits}f})e{power:+03d}"
    if decimals < 0:  # an error of 4300 is known to 100
        return f"{round(value, decimals):.0f} ± {round(error, decimals):.0f}"
    return f"{value:.{decimals}f} ± {error:.{decimals}f}".replace("-", "−")


def brief(value: float, digits: int = 4) -> str:
    """A number with a few significant digits and a true minus sign; ``–`` for NaN."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else ("∞" if value > 0 else "−∞")
    # Rounded first and then written out, so that 13200 is not 1.32e+04.
    return f"{float(f'{value:.{digits}g}'):g}".replace("-", "−", 1 if value < 0 else 0)


def per_cent(share: float) -> str:
    """A share as per cent with two significant digits: ``0.36 %``, ``12 %``, ``350 %``."""
    if not math.isfinite(share):
        return "–"
    number = 100.0 * share
    if 0.0 < abs(number) < 1e-4:
        return f"{number:.0e} %".replace("-", "−")
    digits = 0 if abs(number) >= 9.95 or number == 0.0 else 1 - math.floor(math.log10(abs(number)))
    return f"{number:.{max(digits, 0)}f} %"


def plain(value: object) -> object:
    """The same value in types that JSON has: NaN and infinities as None, NumPy scalars as Python's."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
