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
