"""What users get wrong, in one line each; and what they may do that other bindings break on."""

import copy
import gc
import os
import pickle
import shutil
import signal
import threading
import traceback

import numpy as np
import pytest
from conftest import SETS, small_tracks
from test_fit import recorded, swing, unknowns

import unfurl

T = np.arange(3.0)
P = np.arange(9.0).reshape(3, 3)


def tracks_of(t=T, mark=("a", "a", "a"), p=P, **other):
    return unfurl.Tracks(t, mark, p, **(other or {"sigma": 1e-3}))


@pytest.mark.parametrize(
    "p",
    [
        P.astype("f4"),
        P.astype(int),
        P.astype(">f8"),
        np.asfortranarray(P),
        np.repeat(P, 2, axis=1)[:, ::2],
        P.tolist(),
        P.astype(object),
    ],
)
def test_arrays_of_any_layout_and_real_kind(p):
    np.testing.assert_array_equal(tracks_of(p=p).p, P)


@pytest.mark.parametrize("sigma", [1e-3, np.float32(1e-3), np.array(1e-3), np.full((3, 3), 1e-3)])
def test_sigmas_of_any_kind(sigma):
    np.testing.assert_allclose(tracks_of(sigma=sigma).cov[:, [0, 3, 5]], 1e-6, rtol=1e-6)


def test_what_is_masked_or_not_a_number_is_unsolvable():
    masked = tracks_of(p=np.ma.masked_equal(P, 4.0))
    assert list(masked.usable) == [True, False, True]
    assert np.isnan(masked.p[1]).all() and np.isnan(masked.cov[1]).all()


@pytest.mark.parametrize(
    "arguments, kind, words",
    [
        ({"p": P.astype(complex)}, TypeError, "real numbers, got complex"),
        ({"p": P.astype(str)}, TypeError, "real numbers, got <U"),
        ({"p": [[1, 2, 3], [1, 2], [1, 2, 3]]}, TypeError, "array of numbers"),
        ({"p": P.reshape(3, 3, 1)}, ValueError, r"shape \(n, 2 or 3\), got \(3, 3, 1\)"),
        ({"p": P[:2]}, ValueError, "same length, got 3, 3 and 2"),
        ({"t": T.reshape(3, 1)}, ValueError, r"t: expected shape \(n,\)"),
        ({"t": [0.0, np.nan, 1.0]}, ValueError, "t: expected finite"),
        ({"t": [0.0, 2.0, 1.0]}, ValueError, "order of time"),
        ({"mark": "aaa"}, TypeError, "list of names, got str"),
        ({"mark": [1, 2, 3]}, TypeError, "names, got int"),
        ({"sigma": np.nan}, ValueError, "sigma: expected positive"),
        ({"sigma": "small"}, TypeError, "sigma"),
        ({"cov": np.full((3, 6), np.nan)}, ValueError, "row 0 is not finite"),
        ({"cov": -np.ones((3, 6))}, ValueError, "variance is negative"),
    ],
)
def test_tracks_say_what_does_not_fit(arguments, kind, words):
    tracks_of()
    with pytest.raises(kind, match=words):
        tracks_of(**arguments)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"id": ["a", "a", "c"]}, "different name"),
        ({"p": np.full((3, 3), np.nan)}, "p: expected finite"),
        ({"u": np.full((3, 2), np.inf)}, "u: expected pixels"),
        ({"s": 0.0}, "s: expected a positive"),
        ({"s": np.full((3, 2), np.nan)}, "s: expected a positive"),
        ({"sigma": -1.0}, "sigma: expected a positive"),
        ({"set_up": ["a", "b"]}, "id and set_up: expected the same length"),
        ({"set_up": ["a", "", "b"]}, "set_up: expected a name"),
    ],
)
def test_surveys_say_what_does_not_fit(change, words):
    good = {"id": ["a", "b", "c"], "p": P, "u": np.ones((3, 2)), "s": 0.1, "sigma": 1e-3}
    unfurl.Survey(**good, cameras=["left", "right"])
    with pytest.raises(ValueError, match=words):
        unfurl.Survey(**{**good, **change}, cameras=["left", "right"])


def test_something_else_than_a_record_or_a_path(sets):
    rig = unfurl.load(sets / "deployment" / "rig.h5")
    for call in (unfurl.load, unfurl.simulate, unfurl.calibrate, unfurl.plan, unfurl.fit_study):
        with pytest.raises(TypeError, match="path, got int"):
            call(3)
    with pytest.raises(TypeError, match="a Survey or a path, got Rig"):
        unfurl.calibrate(rig)
    with pytest.raises(TypeError, match="a Run, Tracks or a path, got Rig"):
        unfurl.compare(rig, rig)
    run = unfurl.simulate(sets / "double_pendulum" / "scene.toml", set={"scene.duration": 0.05})
    with pytest.raises(unfurl.Error, match="modes"):
        unfurl.compare(run, run, modes="windy")
    with pytest.raises(TypeError, match="constructor"):
        unfurl.Rig()


def test_values_of_keys(sets):
    scene = sets / "double_pendulum" / "scene.toml"
    run = unfurl.simulate(
        scene, set={"scene.duration": np.float32(0.25), "gravity.acceleration": np.array([0, -1.0])}
    )
    assert run.t[-1] == 0.25
    assert unfurl.simulate(scene, set=["scene.duration=0.25"]).t[-1] == 0.25
    with pytest.raises(TypeError, match="set: expected"):
        unfurl.simulate(scene, set={"scene.duration": object()})
    with pytest.raises(TypeError, match="set: expected"):
        unfurl.simulate(scene, set="scene.duration=0.25")
    with pytest.raises(unfurl.Error, match="finite"):
        unfurl.simulate(scene, set={"scene.duration": float("nan")})


def test_names_that_are_nearly_right(pendulum):
    run = unfurl.simulate(pendulum)
    with pytest.raises(KeyError, match="no quantity 'tip.xx'; did you mean 'tip.x'"):
        run["tip.xx"]
    with pytest.raises(KeyError, match="no quantity 'nothing like it'"):
        run.units("nothing like it")
    assert "tip.xx" not in run


def test_paths_that_are_no_utf8(tmp_path):
    folder = os.fsencode(tmp_path) + b"/caf\xe9"
    os.mkdir(folder)
    scene = folder + b"/scene.toml"
    shutil.copy(os.fsencode(SETS / "double_pendulum" / "scene.toml"), scene)
    run = unfurl.simulate(os.fsdecode(scene), duration=0.1, output=folder + b"/run.h5")
    assert unfurl.load(folder + b"/run.h5").keys() == run.keys()
    assert os.fsencode(unfurl.read_scene(scene).path) == scene
    with pytest.raises(unfurl.Error, match="no such file"):
        unfurl.load(folder + b"/nothing.h5")


@pytest.mark.parametrize("workers", [1, 2])
def test_tracebacks_of_a_model_come_through(workers):
    def inside():
        raise LookupError("of mine")

    def model(parameters, times):
        inside()

    with pytest.raises(LookupError, match="of mine") as caught:
        unfurl.fit(model, recorded(), unknowns(), workers=workers)
    names = [frame.name for frame in traceback.extract_tb(caught.value.__traceback__)]
    assert names[-2:] == ["model", "inside"]


@pytest.mark.parametrize(
    "model, kind, words",
    [
        (lambda p, t: {m: np.zeros((len(x), 4)) for m, x in t.items()}, ValueError, "p of inner"),
        (lambda p, t: {m: np.zeros((3, 2)) for m in t}, ValueError, "3 rows for"),
        (lambda p, t: {m: np.zeros((len(x), 2), complex) for m, x in t.items()}, TypeError, "real"),
        (lambda p, t: {}, KeyError, "no mark 'inner'"),
        (lambda p, t: None, TypeError, "{mark: positions}"),
        (lambda p: None, TypeError, "positional"),
    ],
)
def test_models_that_return_something_else(model, kind, words):
    with pytest.raises(kind, match=words):
        unfurl.fit(model, recorded(), unknowns())


def test_a_model_of_nans_is_a_failed_fit():
    fit = unfurl.fit(
        lambda p, t: {m: np.full((len(x), 2), np.nan) for m, x in t.items()}, recorded(), unknowns()
    )
    assert not fit.usable and "not finite" in fit.message and "not finite" in repr(fit)


def test_models_may_return_lists_and_single_precision():
    expected = unfurl.fit(swing, recorded(), unknowns(), profile_levels=[])
    lists = unfurl.fit(
        lambda p, t: {m: v.tolist() for m, v in swing(p, t).items()},
        recorded(),
        unknowns(),
        profile_levels=[],
    )
    assert [p.value for p in lists.parameters] == [p.value for p in expected.parameters]


def test_parameters_have_names_of_their_own():
    with pytest.raises(unfurl.Error, match="two parameters"):
        unfurl.fit(swing, recorded(), unknowns()[:1] * 2)


def test_parts_outlive_their_records(pendulum):
    """Arrays and parts are views: each keeps the whole record."""
    rig = unfurl.load(SETS / "deployment" / "rig.h5")
    camera, rotation = rig.cameras[2], rig.cameras[2].R_CW
    kept = (camera.name, rotation.copy(), camera.f)
    run = unfurl.simulate(pendulum)
    comparison = unfurl.compare(run, run)
    signal, t = comparison.signals[0], comparison.signals[0].t
    spectra = [s.measured.frequency for s in comparison.spectra]
    copies = [s.copy() for s in spectra]
    times = t.copy()
    plan = unfurl.plan(rig, columns=3, layers=1)
    case, sigma = plan.cases[0], plan.cases[0].sigma
    map_copy = sigma.copy()
    fit = unfurl.fit(swing, recorded(), unknowns(), profile_levels=[])
    parameter, covariance = fit["decay"], fit.covariance
    numbers = (parameter.value, covariance.copy())
    del rig, run, comparison, plan, fit
    gc.collect()
    junk = [np.random.default_rng(0).normal(size=1000) for _ in range(1000)]  # over freed memory
    assert (camera.name, camera.f) == (kept[0], kept[2])
    np.testing.assert_array_equal(rotation, kept[1])
    np.testing.assert_array_equal(t, times)
    np.testing.assert_array_equal(signal.t, times)
    for a, b in zip(spectra, copies):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(case.sigma, map_copy)
    np.testing.assert_array_equal(sigma, map_copy)
    assert parameter.value == numbers[0]
    np.testing.assert_array_equal(covariance, numbers[1])
    del junk


def test_an_observers_sample_may_be_kept(pendulum):
    samples, arrays = [], []
    run = unfurl.simulate(
        pendulum,
        duration=0.1,
        observer=lambda s: (samples.append(s), arrays.append(s.values)),
    )
    gc.collect()
    at = samples[0].keys().index("tip.x")
    np.testing.assert_array_equal([s["tip.x"] for s in samples], run["tip.x"])
    np.testing.assert_array_equal([a[at] for a in arrays], run["tip.x"])


def test_threads_share_records_and_run_side_by_side(pendulum):
    expected = unfurl.simulate(pendulum)["tip.x"].copy()
    failures = []

    def work():
        try:
            for _ in range(5):
                np.testing.assert_array_equal(unfurl.simulate(pendulum)["tip.x"], expected)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


def test_records_are_pickled(tmp_path):
    run = unfurl.simulate(SETS / "bouncing_latch" / "scene.toml", duration=1.2)
    again = pickle.loads(pickle.dumps(run))
    assert repr(again) == repr(run) and again.summary == run.summary and again.text == run.text
    assert [(e.t, e.kind, e.where, e.data) for e in again.events] == [
        (e.t, e.kind, e.where, e.data) for e in run.events
    ]
    for name in run.keys():
        np.testing.assert_array_equal(again[name], run[name])
        assert again.units(name) == run.units(name)
        assert again.description(name) == run.description(name)
    rig = unfurl.load(SETS / "deployment" / "rig.h5")
    copied = copy.deepcopy(rig)
    np.testing.assert_array_equal(copied.covariance, rig.covariance)
    copied.write(tmp_path / "rig.h5")  # it still knows its sources
    survey = unfurl.load(SETS / "deployment" / "survey.h5")
    assert repr(pickle.loads(pickle.dumps(survey))) == repr(survey)
    fit = unfurl.fit(swing, recorded(), unknowns(), profile_levels=[])
    assert repr(pickle.loads(pickle.dumps(fit))) == repr(fit)
    parameter = unfurl.Parameter("k", 2.0, 1.0, 3.0, unit="N/m", log=True, prior=(2.0, 0.1))
    assert repr(pickle.loads(pickle.dumps(parameter))) == repr(parameter)
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(unfurl.read_scene(SETS / "double_pendulum" / "scene.toml"))


def test_tracks_are_pickled_to_the_bit():
    tracks = small_tracks()
    again = pickle.loads(pickle.dumps(tracks))
    for name in ("t", "mark", "p", "cov", "status", "shared"):
        np.testing.assert_array_equal(getattr(again, name), getattr(tracks, name))
    assert again.marks == tracks.marks and again.frame == tracks.frame


def test_errors_are_pickled():
    with pytest.raises(unfurl.Error) as caught:
        unfurl.load("/nowhere.h5")
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is unfurl.Error
    for part in ("what", "where", "remedy"):
        assert getattr(again, part) == getattr(caught.value, part)


def test_every_object_has_a_repr(tmp_path):
    deployment = SETS / "deployment"
    scene = SETS / "bouncing_latch" / "scene.toml"
    run = unfurl.simulate(scene)
    fit = unfurl.fit(swing, recorded(), unknowns(), profile_levels=[])
    plan = unfurl.plan(deployment / "rig.h5", columns=3, layers=1)
    calibration = unfurl.calibrate(deployment / "survey.h5", order="pinhole", folds=2)
    comparison = unfurl.compare(run, run)
    cost = unfurl.cost(scene, rtol=[1e-3, 1e-4], methods=["projected"], duration=0.2)
    seen = []
    unfurl.simulate(scene, duration=0.01, observer=seen.append)
    objects = [
        run,
        run.events[0],
        fit,
        fit["decay"],
        plan,
        plan.cases[0],
        plan.rig,
        plan.rig.cameras[0],
        calibration,
        calibration.cameras[0],
        unfurl.check(calibration.rig, deployment / "survey.h5"),
        comparison,
        comparison.errors[0],
        comparison.scores[0],
        comparison.signals[0],
        cost,
        cost.points[0],
        cost.lines[0],
        unfurl.load(deployment / "lab.toml"),
        unfurl.load(deployment / "study.toml"),
        unfurl.read_scene(scene),
        unfurl.compile(scene),
        unfurl.modes(SETS / "double_pendulum" / "scene.toml"),
        unfurl.load(deployment / "survey.h5"),
        unknowns()[0],
        small_tracks(),
        seen[0],
    ]
    for thing in objects:
        assert repr(thing).startswith(f"<unfurl.{type(thing).__name__}"), repr(thing)
        assert "object at 0x" not in repr(thing)


@pytest.mark.parametrize("raised", [KeyboardInterrupt, ZeroDivisionError])
def test_what_a_path_itself_raises_is_no_wrong_type(raised):
    class Path:
        def __fspath__(self):
            raise raised

    with pytest.raises(raised):
        unfurl.plan(Path())
    with pytest.raises(raised):
        unfurl.simulate(Path())


def interrupted(call, after=0.1):
    """Whether SIGINT ends the call by KeyboardInterrupt."""
    timer = threading.Timer(after, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            for _ in range(1000):
                call()
    finally:
        timer.join()


def test_ctrl_c_ends_every_long_call_and_leaves_nothing(tmp_path):
    deployment = SETS / "deployment"
    lab, rig = deployment / "lab.toml", unfurl.load(deployment / "rig.h5")
    run = unfurl.simulate(deployment / "scene_suspension_4.toml", duration=0.6)
    trial, _ = unfurl.expose(run, lab, tmp_path / "trial.h5")
    tracks = unfurl.reconstruct(trial, rig)
    tracks.write(tmp_path / "tracks.h5")
    before = sorted(tmp_path.iterdir())
    study = unfurl.read_study(
        deployment / "study.toml", set={"study.scene": str(deployment / "scene_suspension_4.toml")}
    )
    interrupted(lambda: unfurl.calibrate(deployment / "survey.h5"))
    interrupted(lambda: unfurl.plan(rig, columns=100, layers=20))
    interrupted(lambda: unfurl.expose(run, lab, tmp_path / "other.h5"))
    interrupted(lambda: unfurl.expose_survey(deployment / "points.csv", lab))
    interrupted(lambda: unfurl.reconstruct(trial, rig))
    interrupted(lambda: unfurl.compare(tracks, run))
    interrupted(lambda: unfurl.modes(deployment / "scene_suspension.toml"))
    interrupted(lambda: unfurl.cost(deployment / "scene_suspension_4.toml"))
    interrupted(lambda: unfurl.fit_study(study, tracks=tmp_path / "tracks.h5"))
    interrupted(lambda: tracks.smooth())
    (tmp_path / "other.h5").unlink(missing_ok=True)  # of a call that had ended before the signal
    assert sorted(tmp_path.iterdir()) == before
    assert unfurl.check(rig, deployment / "survey.h5").usable
