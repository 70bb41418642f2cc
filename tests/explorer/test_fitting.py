"""Fits of the page: from the sliders, in a process of its own that ends at once."""

import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import pbrdf
from pbrdf.errors import FitError
from pbrdf.explorer.catalogue import layer_of, state_of
from pbrdf.explorer.fit_process import process_of
from pbrdf.explorer.fit_worker import found_by
from pbrdf.explorer.fitting import job_of
from pbrdf.explorer.session import Session
from pbrdf.explorer.state import StateError, read_state
from pbrdf.explorer.workspace import Workspace


@pytest.fixture
def experiment():
    return pbrdf.open_experiment("matte-white-thick")


@pytest.fixture
def displaced(white):
    return white.replace(sigma=0.09, n=1.45, a=3.0, k=1.0, b=0.0, t=0.3)


def content_of(model, **settings):
    return {**state_of([layer_of("white", model)]), "settings": settings}


def runs(pid):
    """Whether a process has this number."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def gone(pid):
    """Whether a process has ended; waits, as the system takes a moment to say so."""
    for _ in range(200):
        if not runs(pid):
            return True
        time.sleep(0.05)
    return False


class Page:
    """A session without a browser."""

    def __init__(self, workspace):
        self.heard, self.news = [], threading.Condition()
        self.session = Session(workspace, self.hear)

    def hear(self, content, buffers):
        with self.news:
            self.heard.append(content)
            self.news.notify_all()

    def ask(self, kind, content, *ends):
        """Send a request and return the first answer of one of these types."""
        start = len(self.heard)
        self.session.receive({"type": kind, "id": 1, "state": content})

        def answered():
            return next((m for m in self.heard[start:] if m["type"] in ends), None)

        with self.news:
            assert self.news.wait_for(answered, 60), self.heard[start:]
            return answered()


@pytest.fixture
def page(experiment):
    page = Page(Workspace(datasets=[("white", experiment)]))
    yield page
    page.session.close()


def test_displaced_sliders_come_back_within_their_standard_errors(experiment, white, displaced):
    workspace, told = Workspace(datasets=[("white", experiment)]), []
    job = job_of(read_state(content_of(displaced, fit={"starts": 8})), workspace)
    found = found_by(job, told.append)
    for estimate in found["estimates"]:
        true = white.values[estimate["name"]]
        if estimate["verdict"] != "fixed":
            assert abs(estimate["value"] - true) < 4.0 * estimate["std"], estimate
    assert found["values"]["kappa"] == 0.0
    result = pbrdf.fit(experiment, displaced, starts=8)
    assert found["chi2"] == pytest.approx(result.goodness.chi2, rel=1e-9)
    assert found["verdict"] == result.verdict().sentence
    np.testing.assert_allclose(found["correlation"]["matrix"], result.correlation.values, atol=1e-9)
    assert (told[0]["done"], told[0]["of"], told[-1]["done"]) == (0, 8, 8)
    S = displaced.stokes(*(experiment[name].values for name in ("theta_i", "theta_r", "phi")))
    before = sum(
        float((((S[:, k] - experiment[name].values) / experiment[f"{name}_std"].values) ** 2).sum())
        for k, name in enumerate("IQUV")
    )
    assert told[0]["chi2"] == pytest.approx(before, rel=1e-6)
    assert found["chi2_before"] == told[0]["chi2"] > 100.0 * found["chi2"]


def test_points_switched_off_or_held_out_are_not_used(experiment, white):
    """They are spoilt here: a fit that used one would not find the paint."""
    spoilt = experiment.copy(deep=True)
    spoilt["I"][{"geometry": slice(0, 5)}] *= 30.0
    spoilt["I"][{"geometry": slice(42, 63)}] *= 1.5  # group 3
    workspace = Workspace(datasets=[("white", spoilt)])
    held = {"kind": "group", "values": ["3"]}
    content = content_of(white, data={"off": [0, 1, 2, 3, 4], "held_out": held}, fit={"starts": 1})
    found = found_by(job_of(read_state(content), workspace), lambda _: None)
    assert found["fitted"]["count"] == 37 and found["predicted"]["count"] == 21
    assert found["reduced_chi2"] < 1.5
    assert found["predicted"]["intensity"] == pytest.approx(1.0 / 3.0, abs=0.02)
    assert found["held_out"] == "group=3"
    content["settings"]["data"] = {}
    assert found_by(job_of(read_state(content), workspace), lambda _: None)["reduced_chi2"] > 100.0


def test_parameters_are_held_and_freed_by_name(experiment, white):
    workspace = Workspace(datasets=[("white", experiment)])
    content = content_of(
        white.replace(n=1.55), fit={"held": ["n", "of another model"], "free": ["kappa"], "starts": 3}
    )
    job = job_of(read_state(content), workspace)
    assert (job["fix"], job["free"], job["starts"]) == ({"n": 1.55}, ["kappa"], 3)


@pytest.mark.parametrize(
    "settings, place",
    [
        ({"fit": {"starts": 0}}, "settings.fit.starts"),
        ({"fit": {"starts": 10**6}}, "settings.fit.starts"),
        ({"fit": {"held": "n"}}, "settings.fit.held"),
        ({"fit": {"free": [1]}}, "settings.fit.free"),
        ({"data": {"off": list(range(63))}}, "settings.data.off"),
    ],
)
def test_what_is_no_fit_is_refused_in_words(experiment, white, settings, place):
    with pytest.raises(StateError) as caught:
        job_of(read_state(content_of(white, **settings)), Workspace(datasets=[("white", experiment)]))
    assert caught.value.place == place
    with pytest.raises(StateError, match="open measured data first"):
        job_of(read_state(content_of(white)), Workspace())


@pytest.mark.slow
def test_a_fit_runs_beside_and_cancelling_ends_its_process(page, displaced, white):
    content = content_of(displaced)
    assert page.ask("cancel_fit", content, "error")["text"] == "no fit is running"
    found = page.ask("fit", content, "fitted", "error")
    assert found["type"] == "fitted"
    assert (found["layer"], found["name"], found["model"]) == (0, "white", white.name)
    assert abs(found["values"]["sigma"] - white.values["sigma"]) < 5e-4
    fitting = process_of(page.session.workspace)
    first = fitting.pid
    assert not fitting.busy and runs(first)
    # errors of the fit itself come in its own words
    few = [row for row in range(63) if row != 30]
    wrong = {**content, "settings": {"data": {"off": few}}}
    answer = page.ask("fit", wrong, "fitted", "error")
    assert answer["place"] == "settings.fit" and "cannot determine" in answer["text"]
    # one that takes long enough to meet a second and to be cancelled
    long = {**content, "settings": {"fit": {"starts": 256}}}
    page.ask("fit", long, "fit_started")
    refused = page.ask("fit", long, "error", "fitted")
    assert refused["type"] == "error" and "a fit is running" in refused["text"]
    assert page.ask("cancel_fit", long, "fit_cancelled")
    assert gone(first)
    second = fitting.pid  # the next one is ready
    assert second not in (None, first)
    assert page.ask("fit", content, "fitted", "error")["chi2"] == pytest.approx(found["chi2"])
    page.session.close()
    assert gone(second)


@pytest.mark.slow
def test_no_process_outlives_its_server():
    """Also where the server is killed and can tidy up nothing."""
    program = (
        "from pbrdf.explorer.fit_process import FitProcess; import time\n"
        "process = FitProcess(); process.warm(); print(process.pid, flush=True); time.sleep(60)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, env=environment, text=True
    ) as server:
        worker = int(server.stdout.readline())
        assert runs(worker)
        server.kill()
    assert gone(worker)


@pytest.mark.slow
def test_a_model_that_no_other_process_knows_is_said_to_be_one(experiment, white, monkeypatch):
    workspace, heard, end = Workspace(datasets=[("white", experiment)]), [], threading.Event()
    job = job_of(read_state(content_of(white)), workspace)

    class Local(type(white)):
        name = "local"

    own = Local(**white.values)
    process = process_of(workspace)
    with pytest.raises(FitError, match="cannot be fitted by a process beside"):
        process.start({**job, "model": own}, heard.append)
    assert not process.busy
    # as in a notebook, where the class stands in __main__
    Local.__module__, Local.__qualname__ = "__main__", "Local"
    monkeypatch.setattr(sys.modules["__main__"], "Local", Local, raising=False)
    process.start({**job, "model": own}, lambda message: (heard.append(message), end.set()))
    assert end.wait(60)
    assert "in a module that can be imported" in heard[-1]["text"]
    workspace.close()


def test_a_process_that_ended_is_said_to_have_and_replaced(experiment, white):
    workspace = Workspace(datasets=[("white", experiment)])
    process_of(workspace).warm()
    first = process_of(workspace).pid
    heard, end = [], threading.Event()
    job = job_of(read_state(content_of(white)), workspace)
    process_of(workspace).start(job, lambda message: (heard.append(message), end.set()))
    process_of(workspace)._child.kill()
    assert end.wait(30)
    assert heard[-1]["kind"] == "error" and "has ended" in heard[-1]["text"]
    process_of(workspace).warm()
    assert process_of(workspace).pid != first
    workspace.close()
    process_of(workspace).warm()
    assert process_of(workspace).pid is None  # a closed page starts nothing
    with pytest.raises(FitError, match="no process can be started"):
        process_of(workspace).start(job, heard.append)
