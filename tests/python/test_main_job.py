"""The main job in Python: the numbers are the program's."""

import numpy as np
import pytest

import unfurl
from conftest import SETS, read_by_strangers, run


DAMPING = 2e-4  # of the beams in the truth [s]
DAMPED = {f"beam.beam{k}.damping": DAMPING for k in range(1, 5)}


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("job")
    deployment = SETS / "deployment"
    truth = unfurl.simulate(
        deployment / "scene_suspension_4.toml", set=DAMPED, duration=1.2, output=folder / "truth.h5"
    )
    trial, flashes = unfurl.expose(truth, deployment / "lab.toml", folder / "trial.h5")
    tracks = unfurl.reconstruct(trial, deployment / "rig.h5")
    tracks.write(folder / "tracks.h5")
    return folder, deployment, truth, trial, flashes, tracks


def test_calibration_is_the_programs(job):
    folder, deployment, *_ = job
    told = run("calibrate", deployment / "survey.h5", "-o", "rig.h5", cwd=folder)
    found = unfurl.calibrate(deployment / "survey.h5")
    program = unfurl.load(folder / "rig.h5")
    assert found.verdict == told["verdict"] == program.verdict
    assert found.reasons == told["reasons"]
    np.testing.assert_array_equal(found.rig.covariance, program.covariance)
    for a, b in zip(found.rig.cameras, program.cameras):
        np.testing.assert_array_equal(a.p_WC, b.p_WC)
    # Chi-square of some 500 degrees of freedom: within 5 of its standard deviations of them.
    dof = found.degrees_of_freedom
    assert abs(found.chi_square / dof - 1.0) < 5 * np.sqrt(2 / dof)
    assert found.held_out.shape[1] == 3
    assert unfurl.check(found.rig, deployment / "survey.h5").usable


def test_reconstruction_is_the_programs_and_near_the_truth(job):
    folder, deployment, _, _, flashes, tracks = job
    run("reconstruct", "trial.h5", "--rig", deployment / "rig.h5", "-o", "other.h5", cwd=folder)
    other = unfurl.load(folder / "other.h5")
    np.testing.assert_array_equal(other.p, tracks.p)
    np.testing.assert_array_equal(other.status, tracks.status)
    usable = tracks.usable
    assert usable.mean() > 0.95
    error = (tracks.p - flashes.p)[usable]
    sigma = np.sqrt(tracks.cov[usable][:, [0, 3, 5]] + (tracks.shared[usable] ** 2).sum(axis=2))
    # The median of |error| / sigma of a normal variable is 0.67; one draw of the calibration's
    # error is common to all, so it is not to be met closely.
    assert 0.3 < np.median(np.abs(error) / sigma) < 1.5


def test_trial_lines_are_what_was_counted(job):
    trial = job[3]
    t, lit, counts = trial.lines(10, 5)
    assert counts.shape[:2] == (5, len(trial.cameras)) and counts.dtype == np.uint16
    np.testing.assert_allclose(np.diff(t), 1 / trial.line_rate, rtol=1e-6)
    again, _, whole = trial.lines(0, 20)
    np.testing.assert_array_equal(whole[10:15], counts)
    assert trial.lit[lit[0]] in {"mark1", "mark1b", "mark2", "mark3", "dark"}
    with pytest.raises(IndexError):
        trial.lines(len(trial) - 1, 2)


def test_comparison_is_the_programs(job):
    folder, _, truth, _, _, tracks = job
    told = run("correlate", "tracks.h5", "truth.h5", cwd=folder)
    found = unfurl.compare(tracks, truth)
    assert found.usable
    assert found.reasons == told["reasons"]
    by_path = unfurl.compare(folder / "tracks.h5", folder / "truth.h5")
    assert by_path.offset == told["time_offset"]["value"]
    assert [e.rmse for e in by_path.errors] == [e["rmse"] for e in told["errors"]]
    # The file holds the shared factor in 32 bits.
    assert by_path.offset == pytest.approx(found.offset, abs=1e-9)
    assert found.errors[-1].mark == "all" and found.errors[-1].sigmas < 2.0
    signal = found.signals[0]
    assert len(signal.t) == len(signal.measured) == len(signal.reference)


def test_study_is_the_programs(job):
    folder, deployment, *_ = job
    study = (deployment / "study.toml").read_text()
    study = study.replace("scene_suspension.toml", str(deployment / "scene_suspension_4.toml"))
    (folder / "study.toml").write_text(study)
    # One rung: what is held against one another is how the study is handed on, not what a ladder does.
    program = run("fit", "study.toml", "-o", "program.h5", "--set", "profile.levels=[]", "--set",
                  "fidelity.wanted=false", cwd=folder)
    fit = unfurl.fit_study(
        folder / "study.toml", set={"profile.levels": [], "fidelity.wanted": False}, output=folder / "fit.h5"
    )
    assert fit.status == program["status"] == "converged"
    clearance, damping = fit.parameters
    assert abs(clearance.value - 0.0052) < 4 * clearance.sigma and abs(damping.value - DAMPING) < 4 * damping.sigma
    assert [p.value for p in fit.parameters] == [p["value"] for p in program["parameters"]]
    assert [p.sigma for p in fit.parameters] == [p["sigma"] for p in program["parameters"]]
    np.testing.assert_array_equal(
        unfurl.load(folder / "program.h5").simulated, unfurl.load(folder / "fit.h5").simulated
    )
    for name in ("program.h5", "fit.h5", "tracks.h5", "truth.h5", "trial.h5"):
        assert read_by_strangers(folder / name)[1] > 3


def test_simulation_and_exposure_are_the_programs(job):
    folder, deployment, truth, trial, *_ = job
    damped = [word for key, value in DAMPED.items() for word in ("--set", f"{key}={value}")]
    run("simulate", deployment / "scene_suspension_4.toml", "--duration", "1.2", *damped, "-o", "verb.h5", cwd=folder)
    again = unfurl.load(folder / "verb.h5")
    assert again.keys() == truth.keys() and again.summary == truth.summary
    for name in truth:
        np.testing.assert_array_equal(again[name], truth[name])
    run("expose", "verb.h5", "--lab", deployment / "lab.toml", "-o", "verb_trial.h5", cwd=folder)
    recorded = unfurl.load(folder / "verb_trial.h5")
    for a, b in zip(recorded.lines(0, len(recorded)), trial.lines(0, len(trial))):
        np.testing.assert_array_equal(a, b)


def test_plan_check_modes_and_cost_are_the_programs(job):
    folder, deployment, *_ = job
    told = run("plan", deployment / "lab.toml", cwd=folder)
    plan = unfurl.plan(deployment / "lab.toml")
    assert (plan.verdict, plan.reasons, plan.need) == (told["verdict"], told["reasons"], told["need_m"])
    for case, row in zip(plan.cases, told["cases"], strict=True):
        assert (case.name, case.found) == (row["cameras"], row["found"])
        assert (case.quantile(0.5), case.quantile(0.95)) == (row["median_m"], row["p95_m"])
    told = run("check", deployment / "rig.h5", deployment / "survey.h5", cwd=folder)
    check = unfurl.check(deployment / "rig.h5", deployment / "survey.h5")
    assert (check.verdict, check.reasons) == (told["verdict"], told["reasons"])
    assert (check.chance, check.rms) == (told["chance"], told["rms"])
    scene = deployment / "scene_suspension_4.toml"
    told = run("modes", scene, cwd=folder)
    modes = unfurl.modes(scene)
    assert list(modes.frequency) == [m["frequency"] for m in told["modes"]]
    assert list(modes.damping) == [m["damping"] for m in told["modes"]]
    latch = SETS / "bouncing_latch" / "scene.toml"
    told = run("cost", latch, "--duration", "0.2", "--rtol", "1e-3,1e-4", cwd=folder)
    cost = unfurl.cost(latch, duration=0.2, rtol=[1e-3, 1e-4])
    assert cost.reference == told["reference"]
    assert [p.rms for p in cost.points] == [p["rms"] for p in told["settings"]]
    assert [line.reference_error for line in cost.lines] == [l["reference_error"] for l in told["lines"]]


def test_plan_of_a_rig(job):
    deployment = job[1]
    plan = unfurl.plan(deployment / "rig.h5", columns=6, layers=2)
    assert [case.name for case in plan.cases] == ["all cameras"] + [
        f"without {c.name}" for c in plan.rig.cameras
    ]
    everything = plan.cases[0]
    assert everything.sigma.shape == (2, 6, 6)
    assert np.isfinite(everything.sigma).mean() == pytest.approx(everything.found)
    for case in plan.cases[1:]:
        assert case.found <= everything.found


def test_planned_surveys_are_the_programs(job):
    folder, deployment, *_ = job
    accuracy, at = "1mm+2ppm, 5arcsec", (3.0, -2.0, 0.5)
    points = deployment / "points.csv"
    for what in ("lab.toml", "rig.h5"):
        words = ("--points", points, "--station", accuracy, "--station-at", "3,-2,0.5", "--columns", 4)
        told = run("plan", deployment / what, *words, "--layers", 2, cwd=folder)
        plan = unfurl.plan(
            deployment / what, points=points, station=accuracy, station_at=at, columns=4, layers=2
        )
        assert plan.reasons == told["reasons"]
        for case, row in zip(plan.cases, told["cases"], strict=True):
            assert (case.name, case.quantile(0.5)) == (row["cameras"], row["median_m"])
    # A survey as a record is the same as its file; its own sigmas serve without a station.
    survey = unfurl.load(deployment / "survey.h5")
    by_record = unfurl.plan(deployment / "rig.h5", points=survey, columns=3, layers=1)
    assert by_record.cases[0].quantile(0.5) < plan.cases[0].quantile(0.5)
    with pytest.raises(unfurl.Error, match="station: needs places"):
        unfurl.plan(deployment / "lab.toml", station=accuracy)
    with pytest.raises(unfurl.Error, match="no accuracy of a station"):
        unfurl.plan(deployment / "lab.toml", points=points, station="fine", station_at=at)
    with pytest.raises(unfurl.Error, match="states no uncertainty"):
        unfurl.plan(deployment / "rig.h5", points=points)


def test_survey_of_the_virtual_laboratory(job, tmp_path):
    deployment = job[1]
    survey = unfurl.expose_survey(deployment / "points.csv", deployment / "lab.toml")
    assert survey.has_lines
    shipped = unfurl.load(deployment / "survey.h5")
    assert survey.id == shipped.id
    np.testing.assert_array_equal(survey.p, shipped.p)


def test_wrong_readings_of_three_are_the_programs(job, tmp_path):
    deployment = job[1]
    at = np.arange(300)
    places = np.stack([0.005 * at - 0.7, 0.5 * np.sin(0.04 * at), 0.4 * np.cos(0.03 * at)], axis=1)
    lines = [f"{k},{x:.9f},{y:.9f},{z:.9f}" for k, (x, y, z) in enumerate(places)]
    (tmp_path / "places.csv").write_text("id,x [m],y [m],z [m]\n" + "\n".join(lines) + "\n")
    run("expose", "--survey", "places.csv", "--lab", deployment / "lab.toml", "-o", "lines.h5", cwd=tmp_path)
    run("convert", "lines.h5", "survey.csv", cwd=tmp_path)
    survey = unfurl.load(tmp_path / "survey.csv")
    three, wrong = [0, 1, 3], {25: 30.0, 110: -3.0, 205: 100.0}
    rows = ["time [s],mark,camera,u [px],s [px]"]
    for k in at:
        for c in three:
            u = survey.u[k, c] + (wrong.get(k, 0.0) if c == 3 else 0.0)
            if np.isfinite(u):
                rows.append(f"{0.02 * k:.3f},tip,{survey.cameras[c]},{u:.6f},{survey.s[k, c]:.6f}")
    (tmp_path / "readings.csv").write_text("\n".join(rows) + "\n")
    rig = deployment / "rig.h5"
    told = run("reconstruct", "readings.csv", "--rig", rig, "-o", "tracks.h5", cwd=tmp_path)
    scatter = unfurl.health(tmp_path / "readings.csv", rig).scatter
    theirs = told["health"]["wrong_readings"]
    assert scatter.wrong == theirs["words"]
    assert scatter.wrong_readings == theirs["cameras"]
    assert scatter.wrong_readings == {
        name: 3 if c == 3 else 0 for c, name in enumerate(survey.cameras)
    }
