"""A Python function as the model of a fit: against what the data were made with."""

import os
import signal
import threading

import numpy as np
import pytest

import unfurl

SIGMA = 1e-3  # of a mark's coordinate [m]
TRUTH = {"frequency": 1.3, "decay": 0.35}


def swing(parameters, times):
    """Two marks on an arm that swings freely, let go at t = 0."""
    omega = 2 * np.pi * parameters["frequency"]
    out = {}
    for k, (mark, t) in enumerate(times.items()):
        t = np.maximum(t, 0.0)
        angle = 0.6 * np.exp(-parameters["decay"] * t) * np.cos(omega * t)
        arm = 0.5 * (k + 1)
        out[mark] = np.stack([arm * np.cos(angle), arm * np.sin(angle)], axis=1)
    return out


def recorded(seed: int = 1):
    """The swing as a rig saw it, from half a second before it was let go: turned, shifted, on a clock
    of its own, the marks lit in turn, with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(-0.5, 3.0, 0.01)
    motion = swing(TRUTH, {"inner": t, "outer": t + 0.005})
    p = np.concatenate([motion["inner"], motion["outer"]])
    p = np.column_stack([p, np.zeros(len(p))])
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    p = p @ turn.T + [0.3, -0.2, 1.0] + rng.normal(0.0, SIGMA, p.shape)
    stamps = np.concatenate([t, t + 0.005])
    order = np.argsort(stamps, kind="stable")
    names = np.array(["inner"] * len(t) + ["outer"] * len(t))
    return unfurl.Tracks(stamps[order] + 4.2, list(names[order]), p[order], sigma=SIGMA)


def unknowns():
    return [
        unfurl.Parameter("frequency", 1.25, 0.5, 3.0, unit="Hz", log=True),
        unfurl.Parameter("decay", 0.3, 0.01, 2.0, unit="1/s", log=True),
    ]


def test_a_function_is_fitted():
    phases = []
    fit = unfurl.fit(swing, recorded(), unknowns(), progress=lambda at: phases.append(at.phase))
    assert fit.usable, fit.message
    for name, value in TRUTH.items():
        found = fit[name]
        assert abs(found.value - value) < 4.5 * found.sigma  # 1 in 100,000 by chance
        assert found.sigma < 0.05 * value
        low, high = found.interval
        assert low < found.value < high
    assert fit.checks["chi2_per_dof [1]"] == pytest.approx(1.0, abs=0.15)
    assert fit.evaluations > 5 and "screening" in phases
    residual = (fit.measured - fit.simulated) / fit.sigma
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(1.0, abs=0.1)
    with pytest.raises(KeyError):
        fit["mass"]


def test_standard_errors_are_those_of_the_scatter():
    """Over repeats of the noise the errors, in standard errors, have a mean square of 1."""
    squares = []
    for seed in range(12):
        fit = unfurl.fit(swing, recorded(seed), unknowns(), profile_levels=[])
        squares += [((fit[n].value - v) / fit[n].sigma) ** 2 for n, v in TRUTH.items()]
    # Chi-square of 24: its 0.01% and 99.99% quantiles over 24 are 0.27 and 2.56.
    assert 0.27 < np.mean(squares) < 2.56


def test_workers_change_nothing():
    one = unfurl.fit(swing, recorded(), unknowns(), workers=1)
    two = unfurl.fit(swing, recorded(), unknowns(), workers=2)
    assert [p.value for p in one.parameters] == [p.value for p in two.parameters]
    assert [p.sigma for p in one.parameters] == [p.sigma for p in two.parameters]


def test_velocities_of_the_models_own():
    def with_velocities(parameters, times):
        h = 1e-6
        early = swing(parameters, {m: t - h for m, t in times.items()})
        late = swing(parameters, {m: t + h for m, t in times.items()})
        here = swing(parameters, times)
        return {m: (here[m], (late[m] - early[m]) / (2 * h)) for m in times}

    fit = unfurl.fit(with_velocities, recorded(), unknowns(), profile_levels=[])
    other = unfurl.fit(swing, recorded(), unknowns(), profile_levels=[])
    for name in TRUTH:
        assert abs(fit[name].value - other[name].value) < 0.01 * fit[name].sigma


def test_a_failed_evaluation_is_gone_round():
    failures = []

    def sometimes(parameters, times):
        if parameters["decay"] > 0.5:
            failures.append(parameters["decay"])
            raise unfurl.ModelFailed("too much decay")
        return swing(parameters, times)

    start = [
        unfurl.Parameter("frequency", 1.28, 0.5, 3.0, unit="Hz"),
        unfurl.Parameter("decay", 0.48, 0.01, 2.0, unit="1/s", log=True),
    ]
    fit = unfurl.fit(sometimes, recorded(), start, screened=20, starts=2, profile_levels=[])
    assert fit.usable, fit.message
    assert failures
    assert abs(fit["decay"].value - TRUTH["decay"]) < 4.5 * fit["decay"].sigma


def test_a_model_that_always_fails_is_a_status():
    def never(parameters, times):
        raise unfurl.ModelFailed("out of order")

    fit = unfurl.fit(never, recorded(), unknowns())
    assert not fit.usable and "out of order" in fit.message


def test_mistakes_of_the_model_are_raised():
    with pytest.raises(ZeroDivisionError):
        unfurl.fit(lambda p, t: 1 / 0, recorded(), unknowns())
    with pytest.raises(TypeError, match="positions"):
        unfurl.fit(lambda p, t: 3, recorded(), unknowns())
    with pytest.raises(KeyError, match="outer"):
        unfurl.fit(lambda p, t: {"inner": np.zeros((len(t["inner"]), 2))}, recorded(), unknowns())
    with pytest.raises(ValueError, match="rows"):
        unfurl.fit(lambda p, t: {m: np.zeros((3, 2)) for m in t}, recorded(), unknowns())
    with pytest.raises(ZeroDivisionError):
        unfurl.fit(swing, recorded(), unknowns(), progress=lambda at: 1 / 0)


def test_ctrl_c_ends_a_fit():
    def slow(parameters, times):
        threading.Event().wait(0.05)
        return swing(parameters, times)

    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        while True:
            unfurl.fit(slow, recorded(), unknowns(), workers=2)
    timer.join()
    assert unfurl.fit(swing, recorded(), unknowns(), profile_levels=[]).usable


def test_a_fit_comes_back_from_its_file(tmp_path):
    fit = unfurl.fit(swing, recorded(), unknowns(), name="swing")
    fit.write(tmp_path / "fit.h5")
    again = unfurl.load(tmp_path / "fit.h5")
    assert repr(again) == repr(fit) and again.verdict == fit.verdict
    np.testing.assert_array_equal(again.simulated, fit.simulated)
    np.testing.assert_array_equal(again.covariance, fit.covariance)


def test_parameters_are_checked():
    with pytest.raises(unfurl.Error, match="parameter"):
        unfurl.Parameter("k", 5.0, 0.0, 1.0)
    with pytest.raises(unfurl.Error):
        unfurl.fit(swing, recorded(), [])
    smooth = recorded().smooth()
    assert smooth.smoothed
    with pytest.raises(unfurl.Error, match="smoothed"):
        unfurl.fit(swing, smooth, unknowns())


def test_what_is_known_of_the_clock_is_said():
    fit = unfurl.fit(swing, recorded(), unknowns(), offset=4.2, drift="known", frame="free")
    assert fit.usable, fit.message
    assert any("was known, 4.2 s" in reason for reason in fit.reasons)
    told = unfurl.fit(swing, recorded(), unknowns(), offset=(4.2, 1e-3))
    assert any("known beforehand" in reason for reason in told.reasons)
    for name, value in TRUTH.items():
        assert abs(fit[name].value - value) < 4.5 * fit[name].sigma
        assert fit[name].sigma <= 1.01 * told[name].sigma
    for wrong in ({"offset": "soon"}, {"drift": (0.0, -1.0)}, {"frame": (1e-3, 0.0)}):
        with pytest.raises(unfurl.Error):
            unfurl.fit(swing, recorded(), unknowns(), **wrong)
