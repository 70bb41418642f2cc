"""What is looked at beyond the fit itself: plausibility, identifiability, errors, intervals, cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from pbrdf.inversion.conventions_check import contradicted_conventions, misfit
from pbrdf.inversion.suggestions import suggestions
from pbrdf.inversion.trials import Suggestion
from pbrdf.inversion.verdict import Level
from pbrdf.models.parameters import shown_unit

if TYPE_CHECKING:
    import xarray as xr

    from pbrdf.inversion.bootstrap import Bootstrap
    from pbrdf.inversion.contour import Contour
    from pbrdf.inversion.crossvalidation import CrossValidation
    from pbrdf.inversion.erroranalysis import ErrorAnalysis
    from pbrdf.inversion.identifiability import Identifiability
    from pbrdf.inversion.plausibility import Finding
    from pbrdf.inversion.profile import Profile
    from pbrdf.inversion.result import FitResult

__all__ = ["Checks", "run_checks"]


@dataclass(frozen=True)
class Checks:
    """Further findings about a fit.

    Attributes
    ----------
    plausibility, identifiability, errors
        Made for every fit.
    profile, bootstrap, cross_validation
        None where they were not asked for.
    contours
        Joint regions of the pairs that were asked for.
    conventions
        Readings of the data, other than that stated or assumed, under which the model fits them better.
    suggestions
        Other ways to fit that a quick trial found better.
    """

    plausibility: list[Finding]
    identifiability: Identifiability
    errors: ErrorAnalysis
    profile: Profile | None = None
    bootstrap: Bootstrap | None = None
    cross_validation: CrossValidation | None = None
    contours: list[Contour] = field(default_factory=list)
    conventions: list[Suggestion] = field(default_factory=list)
    suggestions: list[Suggestion] = field(default_factory=list)

    def advice(self) -> list[str]:
        """What to try next, the conventions that the data contradict first."""
        return [s.sentence for s in (*self.conventions, *self.suggestions)]

    def record(self, result: FitResult) -> dict[str, Any]:
        """The findings in types that JSON has, angles in degrees."""
        factor = {name: shown_unit(e.parameter)[0] for name, e in result.estimates.items()}
        record: dict[str, Any] = {
            "plausibility": [
                {"check": f.check, "severity": str(f.severity), "sentence": f.sentence}
                for f in self.plausibility
            ],
            "identifiability": {
                "condition": self.identifiability.condition,
                "sentences": self.identifiability.sentences,
            },
            "error_analysis": self.errors.sentences(),
            "conventions": [asdict(s) for s in self.conventions],
            "suggestions": [asdict(s) for s in self.suggestions],
        }
        if self.profile is not None:
            record["profile"] = {
                "level": self.profile.level,
                "chi2_rise": self.profile.rise,
                "notes": self.profile.notes,
                "intervals": {
                    name: {
                        **asdict(interval),
                        **{end: factor[name] * getattr(interval, end) for end in ("value", "lower", "upper")},
                    }
                    for name, interval in self.profile.intervals.items()
                },
            }
        if self.bootstrap is not None:
            record["bootstrap"] = {
                "samples": self.bootstrap.samples.sizes["sample"],
                "level": self.bootstrap.level,
                "notes": self.bootstrap.notes,
                "percentiles": {
                    str(name): [
                        factor[str(name)] * float(v)
                        for v in self.bootstrap.percentiles.sel(parameter=name).values
                    ]
                    for name in self.bootstrap.percentiles["parameter"].values
                },
            }
        if self.cross_validation is not None:
            record["cross_validation"] = self.cross_validation.sentences()
        if self.contours:
            record["contours"] = [
                {
                    "parameters": [c.a, c.b],
                    "chi2_rise": {f"{level:g}": rise for level, rise in c.rises.items()},
                    "notes": c.notes,
                }
                for c in self.contours
            ]
        return record


def run_checks(
    result: FitResult,
    dataset: xr.Dataset,
    *,
    profile: bool = False,
    bootstrap: int = 0,
    cross_validate: str | None = None,
    contours: Sequence[tuple[str, str]] = (),
    suggest: bool = False,
    fit_arguments: dict[str, Any] | None = None,
) -> Checks:
    """Look at a fit from all sides.

    Parameters
    ----------
    result, dataset
        The fit and its data.
    profile
        Whether to find profile-likelihood intervals.
    bootstrap
        Number of simulated data sets; 0 for none.
    cross_validate
        How to fold the data, see :func:`pbrdf.inversion.crossvalidation.cross_validate`; None for not.
    contours
        Pairs of free parameters whose joint confidence regions to find.
    suggest
        Whether to look for what would describe the data better, where the model does not: a few seconds.
    fit_arguments
        Arguments of the fit, for folds and trials.

    Raises
    ------
    FitError
        If the data cannot be folded as asked, or a pair is not of two free parameters.
    """
    regions = [result.contour(a, b) for a, b in contours]
    folds = None
    if cross_validate is not None:
        from pbrdf.inversion.crossvalidation import cross_validate as run_folds

        folds = run_folds(dataset, by=cross_validate, **(fit_arguments or {}))
    conventions: list[Suggestion] = []
    advice: list[Suggestion] = []
    findings = result.plausibility(dataset)
    if suggest and misfit(result, findings):
        conventions = contradicted_conventions(dataset, result, fit_arguments or {})
        if not conventions and result.verdict().level != Level.DESCRIBES:
            advice = suggestions(dataset, result, fit_arguments or {})
    return Checks(
        plausibility=findings,
        identifiability=result.identifiability(),
        errors=result.error_analysis(),
        profile=result.profile() if profile else None,
        bootstrap=result.bootstrap(bootstrap) if bootstrap else None,
        cross_validation=folds,
        contours=regions,
        conventions=conventions,
        suggestions=advice,
    )
