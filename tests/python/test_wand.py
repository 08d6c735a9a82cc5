"""A bar from Python: a wave traced in NumPy, and the program's answer to the same file."""

import itertools
import pickle
from pathlib import Path

import numpy as np
import pytest

import unfurl
from conftest import SETS, run

LENGTH = 0.6  # [m]
MOST = 3e-4  # [m], ten times what 0.02 px are at 3 m: readings and calibration leave some three times that


def read(camera, points):
    """A cylinder lens without terms: the ratio across its axis, on one row of pixels."""
    p = (points - camera.p_WC) @ np.array(camera.R_CW).T
    u = camera.u0 + camera.f * p[:, 0] / p[:, 2]
    return np.where((p[:, 2] > 0.0) & (u > 0.0) & (u < camera.pixels), u, np.nan)


def waved(rig, poses, seed):
    """The ends of a bar in so many poses within the rig's volume, and what its cameras read of them."""
    rng = np.random.default_rng(seed)
    low, high = (np.array(corner) for corner in rig.volume)
    middle = low + (high - low) * rng.random((poses, 3))
    along = rng.normal(size=(poses, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    ends = np.stack([middle - LENGTH / 2 * along, middle + LENGTH / 2 * along], axis=1).reshape(-1, 3)
    u = np.stack([read(camera, ends) for camera in rig.cameras], axis=1)
    return ends, u + rng.normal(0.0, 0.02, u.shape)


def bar_of(rig, u):
    poses = np.repeat(np.arange(len(u) // 2), 2).astype(str)
    names = [camera.name for camera in rig.cameras]
    return unfurl.Wand(poses, ["a", "b"] * (len(u) // 2), u, 0.02, cameras=names)


def place(rig, u):
    """The point of a row of readings, by Gauss-Newton on differences, begun in several places."""
    low, high = (np.array(corner) for corner in rig.volume)
    best, least = np.full(3, np.nan), np.inf
    for part in itertools.product((0.5, 0.2, 0.8), repeat=3):
        p = low + (high - low) * np.array(part)
        for _ in range(10):
            at = rig.readings(np.vstack([p, p + 1e-5 * np.eye(3)]))
            seen = np.isfinite(u) & np.isfinite(at).all(axis=0)
            slope = (at[1:, seen] - at[0, seen]).T / 1e-5
            p = p + np.linalg.lstsq(slope, u[seen] - at[0, seen], rcond=None)[0]
        off = np.abs(u - rig.readings([p])[0])[np.isfinite(u)]
        if np.isfinite(off).all() and off.max() < least:
            best, least = p, off.max()
        if least < 0.5:  # [px]
            break
    return best


def lengths_of(rig, u):
    """Of the bar, where three cameras or more see both ends."""
    good = np.isfinite(u).sum(axis=1).reshape(-1, 2).min(axis=1) >= 3
    ends = np.array([place(rig, row) for row in u]).reshape(-1, 2, 3)[good]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return lengths[np.isfinite(lengths)]


@pytest.fixture(scope="module")
def wave():
    """The shipped rig before a bar in 60 poses, its readings good to 0.02 px."""
    rig = unfurl.load(SETS / "deployment" / "rig.h5")
    return rig, bar_of(rig, waved(rig, 60, 5)[1])


@pytest.fixture(scope="module")
def found(wave):
    return unfurl.calibrate_wand(wave[1], LENGTH, bar_sigma=1e-4)


def test_a_bar_calibrates(wave, found):
    rig, wand = wave
    assert found.usable, found.reasons
    assert len(found.cameras) == 4 and found.poses == 60 and found.marks == ["a", "b"]
    assert all(camera.residual_rms < 0.03 for camera in found.cameras)
    np.testing.assert_allclose(found.place, [0.0, LENGTH], atol=5e-4)
    # Distances of found points are right: a second wave, which no calibration saw. (Those of the
    # cameras are not known: a ratio across the axis does not change along it.)
    apart = lengths_of(found.rig, waved(rig, 60, 6)[1])
    assert len(apart) > 40 and np.sqrt(np.mean((apart - LENGTH) ** 2)) < MOST
    error, sigma = found.length_error, found.length_sigma
    assert len(error) > 40 and 0.7 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.4
    assert {shape.by_bar for shape in found.shapes} <= {True, False} and "row of" in found.frame


def test_it_is_the_programs(wave, found, tmp_path):
    wave[1].write(tmp_path / "wand.h5")
    wave[1].write(tmp_path / "wand.csv")
    told = run("calibrate", "--wand", "wand.h5", "--bar", f"{LENGTH}m+-0.1mm", "-o", "rig.h5", cwd=tmp_path)
    assert (found.verdict, found.reasons, found.frame) == (told["verdict"], told["reasons"], told["frame"])
    for camera, row in zip(found.rig.cameras, told["cameras"], strict=True):
        assert list(camera.p_WC) == row["position"]
    by_path = unfurl.calibrate_wand(tmp_path / "wand.csv", f"{LENGTH} m +- 0.1 mm")
    assert by_path.verdict == found.verdict
    for ending in ("h5", "csv"):
        loaded = unfurl.load(tmp_path / f"wand.{ending}")
        assert isinstance(loaded, unfurl.Wand) and loaded.pose == wave[1].pose
        np.testing.assert_allclose(loaded.u, wave[1].u, atol=1e-6)


def test_a_frame_by_three_cameras(wave):
    rig, wand = wave
    names = [camera.name for camera in rig.cameras]
    result = unfurl.calibrate_wand(
        wand, LENGTH, bar_sigma=1e-4, frame=names[:3], start=rig
    )
    places = {camera.name: camera.p_WC for camera in result.rig.cameras}
    np.testing.assert_allclose(places[names[0]], 0.0, atol=1e-9)
    np.testing.assert_allclose(places[names[1]][1:], 0.0, atol=1e-9)
    assert places[names[1]][0] > 0.0


def test_a_planned_layout_tells_the_mirror_image_and_is_an_input(wave, tmp_path):
    lab = SETS / "deployment" / "lab.toml"
    ends, _ = waved(wave[0], 40, 9)
    u = wave[0].readings(ends) + np.random.default_rng(9).normal(0.0, 0.02, (80, 4))
    result = unfurl.calibrate_wand(bar_of(wave[0], u), LENGTH, bar_sigma=1e-4, layout=unfurl.load(lab))
    assert result.handed and "planned places" in result.frame
    result.rig.write(tmp_path / "rig.h5")
    assert [Path(i["path"]).name for i in run("info", "rig.h5", cwd=tmp_path)["inputs"]] == ["lab.toml"]


def test_known_lenses_take_fewer_poses(wave):
    rig = wave[0]
    ends, _ = waved(rig, 40, 7)
    u = rig.readings(ends) + np.random.default_rng(8).normal(0.0, 0.02, (80, 4))
    known = unfurl.calibrate_wand(bar_of(rig, u), LENGTH, bar_sigma=1e-4, lenses=rig)
    assert known.usable and known.poses == 40, known.reasons
    assert np.sqrt(np.mean((lengths_of(known.rig, u) - LENGTH) ** 2)) < MOST
    # The lenses of other cameras are not these: ideal ones, which have no terms.
    with pytest.raises(unfurl.Error, match="contradict"):
        unfurl.calibrate_wand(wave[1], LENGTH, bar_sigma=1e-4, lenses=rig)


def test_what_a_rig_reads(wave):
    rig = wave[0]
    low, high = (np.array(corner) for corner in rig.volume)
    p = low + (high - low) * np.random.default_rng(2).random((60, 3))
    u = rig.readings(p)
    assert u.shape == (60, 4) and np.isfinite(u).any(axis=1).all()
    # Terms of the lens are what is left beside the ratio.
    for j, camera in enumerate(rig.cameras):
        assert np.nanmax(np.abs(u[:, j] - read(camera, p))) < 0.05 * camera.pixels
    survey = unfurl.Survey([f"p{i}" for i in range(60)], p, u, 0.02, cameras=[c.name for c in rig.cameras], sigma=1e-5)
    check = unfurl.check(rig, survey)
    assert check.verdict == "still valid" and check.rms < 1e-4
    behind = 2.0 * np.array(rig.cameras[0].p_WC) - p.mean(axis=0)
    assert np.isnan(rig.readings([behind])[0, 0]) and np.isnan(rig.readings([[np.nan] * 3])).all()


def test_records_come_back(wave, found):
    wand = wave[1]
    again = pickle.loads(pickle.dumps(wand))
    np.testing.assert_array_equal(again.u, wand.u)
    assert len(wand) == 120 and again.cameras == wand.cameras and len(again.time) == 0
    for thing in (wand, found, found.cameras[0], found.shapes[0]):
        assert repr(thing).startswith(f"<unfurl.{type(thing).__name__}"), repr(thing)


@pytest.mark.parametrize(
    "change, kind, words",
    [
        ({"bar": "0.6m"}, unfurl.Error, "does not say how well"),
        ({"bar": 0.6}, unfurl.Error, "bar_sigma: 0.6 \\+- 0 m"),
        ({"bar": "0.6m+-1mm", "bar_sigma": 1e-3}, unfurl.Error, "bar_sigma"),
        ({"bar": 0.0, "bar_sigma": 1e-3}, unfurl.Error, "no length"),
        ({"bar": [0.3, 0.6], "bar_sigma": 1e-3}, unfurl.Error, "2 marks .* but the bar has 3"),
        ({"frame": ["a"]}, unfurl.Error, "three cameras"),
        ({"plumb": "1"}, unfurl.Error, "other half"),
        ({"lens": "fish"}, unfurl.Error, "no lens model 'fish'"),
        ({"readings": 3.0}, TypeError, "a Wand or a path"),
    ],
)
def test_what_makes_no_sense(wave, change, kind, words):
    arguments = {"readings": wave[1], "bar": LENGTH} | change
    if change.keys() & {"frame", "plumb", "lens", "readings"}:
        arguments["bar_sigma"] = 1e-4
    with pytest.raises(kind, match=words):
        unfurl.calibrate_wand(arguments.pop("readings"), arguments.pop("bar"), **arguments)


def test_readings_that_do_not_fit():
    with pytest.raises(ValueError, match="same number of flashes"):
        unfurl.Wand(["1"], ["a", "b"], [[1.0], [2.0]], 0.1, cameras=["c"])
    with pytest.raises(ValueError, match="positive number"):
        unfurl.Wand(["1"], ["a"], [[1.0]], -0.1, cameras=["c"])
    with pytest.raises(ValueError, match="pixels: expected"):
        unfurl.Wand(["1"], ["a"], [[1.0]], 0.1, cameras=["c"], pixels=[1, 2])
