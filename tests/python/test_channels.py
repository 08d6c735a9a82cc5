"""Channels: read, compared, described; what was planted comes back."""

import math
import random

import pytest

import unfurl


def angle(t):
    return 0.2 * math.exp(-0.15 * t) * math.cos(2 * math.pi * 0.9 * t)


def test_channels_beside_channels(tmp_path):
    noise = random.Random(1)
    t = [0.8 + 0.01 * k for k in range(1000)]
    y = [math.degrees(angle(x - 0.8)) + noise.gauss(0, 0.02) for x in t]
    record = unfurl.Channel("hinge", t, y, unit="deg", sigma=[0.02] * len(t))
    assert len(record) == 1000 and record.unit == "deg"
    path = tmp_path / "b.csv"
    path.write_text("t [s],angle [rad]\n" + "".join(f"{0.004 * k:.4f},{angle(0.004 * k):.9g}\n" for k in range(3000)))
    (reference,) = unfurl.read_channels(path)
    assert reference.name == "angle" and len(reference.sigma) == 0
    agree = unfurl.compare_channels(record, [reference], channels={"hinge": "angle"})
    assert agree.usable and agree.vibration == "decay"
    assert agree.offset == pytest.approx(0.8, abs=1e-3)
    assert agree.channels == [{"name": "hinge", "unit": "deg", "of": "angle"}]
    assert agree.scores[0].unit == "deg" and agree.scores[0].r2 > 0.999
    (mode,) = agree.measured_modes
    assert mode["frequency"] == pytest.approx(math.hypot(0.15 / (2 * math.pi), 0.9), abs=4.5 * mode["frequency_sigma"])
    alone = unfurl.compare_channels(path)
    assert alone.usable and alone.channels[0]["of"] == ""


def test_what_cannot_be_compared_says_so():
    load = unfurl.Channel("x", [0, 1, 2, 3], [0, 1, 0, 1], unit="N")
    place = unfurl.Channel("x", [0, 1, 2, 3], [0, 1, 0, 1], unit="m")
    with pytest.raises(unfurl.Error, match="'x' is in 'N'"):
        unfurl.compare_channels(load, place)
    with pytest.raises(unfurl.Error, match="do not ascend"):
        unfurl.Channel("x", [0, 0], [1, 2])


PENDULUM = """
[scene]
name = "pendulum"
duration = 7.0
[gravity]
acceleration = [0.0, -9.81]
[body.arm]
mass = 1.0
inertia = 0.05
[joint.hinge]
inner = "ground"
outer = "arm"
outer_point = [-0.5, 0.0]
zero_angle = -1.5707963267948966
theta = 0.6
[joint.hinge.damper]
damping = 0.02
"""

STUDY = """
[study]
scene = "pendulum.toml"
[[trial]]
[trial.channel.encoder]
file = "a.csv"
column = "angle"
quantity = "hinge.theta"
bias = "free"
sigma = 0.05
[[trial]]
[trial.channel.other]
file = "a.csv"
column = "angle"
quantity = "hinge.theta"
bias = "free"
sigma = 0.05
[parameter.damping]
keys = ["joint.hinge.damper.damping"]
start = 0.03
bounds = [0.001, 0.1]
"""


def test_a_studys_instruments_against_a_run(tmp_path):
    (tmp_path / "pendulum.toml").write_text(PENDULUM)
    (tmp_path / "study.toml").write_text(STUDY)
    run = unfurl.simulate(tmp_path / "pendulum.toml", rate=1000, output=tmp_path / "run.h5")
    theta, t = run["hinge.theta"], run.t
    noise = random.Random(2)
    rows = [f"{t[k] + 0.25:.6f},{1.5 + math.degrees(theta[k]) + noise.gauss(0, 0.05):.6f}\n" for k in range(0, 6500, 10)]
    (tmp_path / "a.csv").write_text("t [s],angle [deg]\n" + "".join(rows))
    study = unfurl.read_study(tmp_path / "study.toml")
    by_object = unfurl.compare_channels(study, run, trial="trial 2")
    by_path = unfurl.compare_channels(tmp_path / "study.toml", tmp_path / "run.h5", trial="trial 2")
    for c in (by_object, by_path):
        assert c.usable and c.channels[0]["name"] == "other"
        assert c.offset == pytest.approx(0.25, abs=1e-3)
        assert c.scores[0].sigmas == pytest.approx(1.0, abs=0.1)  # the bias is fitted
    with pytest.raises(unfurl.Error, match="several trials"):
        unfurl.compare_channels(study, run)
    with pytest.raises(unfurl.Error, match="no channel 'gyro'"):
        unfurl.compare_channels(study, run, trial="trial 2", channels={"gyro": "gyro"})
    with pytest.raises(unfurl.Error, match="no study"):
        unfurl.compare_channels(tmp_path / "a.csv", run, trial="trial 2")
