"""What is evaluated around a fit: each kernel more is compiled the first time and loaded every time."""

import drjit as dr
import pytest

from pbrdf.inversion.comparison import compared_channels
from pbrdf.inversion.problem import predict
from pbrdf.report.fit.checks import run_checks
from pbrdf.report.fit.figure import fit_figure
from pbrdf.report.fit.polarisation_figure import polarisation_figure


@pytest.fixture
def launched():
    """Kernels launched since the last call, as a set."""

    def kernels():
        return {kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])}

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        kernels()
        yield kernels
        dr.kernel_history_clear()


def test_figures_need_no_kernel_but_that_of_the_comparison(report, launched):
    result = report.result
    predict(result.space, result.unknowns, result.data, compared_channels(result.data.channels))
    compared = launched()
    fit_figure(report)
    polarisation_figure(report)
    assert launched() == compared and len(compared) == 1


def test_checks_of_a_good_fit_launch_a_specular_and_a_whole_kernel(report, launched):
    """No refit: χ² of the optimum is asked for only where a combination of parameters is nearly free."""
    run_checks(report.result, report.dataset)
    assert len(launched()) == 2
