"""Records: what arrays show is the record's own memory, and files give back what was written."""

import gc

import numpy as np
import pytest
from conftest import small_tracks

import unfurl


def address(array):
    return array.__array_interface__["data"][0]


def test_arrays_are_views_that_keep_the_record():
    tracks = small_tracks()
    assert address(tracks.p) == address(tracks.p)
    assert not tracks.p.flags.owndata and not tracks.p.flags.writeable
    with pytest.raises(ValueError):
        tracks.p[0, 0] = 1.0
    p, t = tracks.p, tracks.t
    expected = np.stack([np.cos(t), np.sin(t), 0.1 * t], axis=1)
    del tracks
    gc.collect()
    np.testing.assert_array_equal(p, expected)


def test_columns_of_a_run_are_views(pendulum):
    run = unfurl.simulate(pendulum)
    assert address(run["tip.x"]) == address(run["tip.x"])
    assert address(run["tip.x"]) != address(run["tip.y"])
    column = run["tip.x"]
    copy = column.copy()
    del run
    gc.collect()
    np.testing.assert_array_equal(column, copy)


@pytest.mark.parametrize("ending", ["h5", "csv", "c3d", "uff"])
def test_tracks_come_back(tmp_path, ending):
    tracks = small_tracks()
    path = tmp_path / f"tracks.{ending}"
    tracks.write(path)
    again = unfurl.load(path)
    assert isinstance(again, unfurl.Tracks)
    at = {name: again.samples(name) for name in again.marks}
    for name in tracks.marks:
        samples = tracks.samples(name)
        # C3D holds millimetres in 32-bit floats: 1 m to 6e-8.
        tolerance = 1e-7 if ending == "c3d" else 1e-15
        key = next(k for k in at if k.strip() == name)
        np.testing.assert_allclose(again.p[at[key]], tracks.p[samples], atol=tolerance)
        np.testing.assert_allclose(again.t[at[key]], tracks.t[samples], atol=1e-6)


def test_tracks_refuse_what_does_not_fit():
    t = np.arange(3.0)
    with pytest.raises(ValueError, match=r"p: expected shape \(n, 2 or 3\)"):
        unfurl.Tracks(t, ["a"] * 3, np.zeros((3, 4)), sigma=1e-3)
    with pytest.raises(ValueError, match="same length"):
        unfurl.Tracks(t, ["a"] * 2, np.zeros((3, 3)), sigma=1e-3)
    with pytest.raises(ValueError, match="either cov"):
        unfurl.Tracks(t, ["a"] * 3, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="positive"):
        unfurl.Tracks(t, ["a"] * 3, np.zeros((3, 3)), sigma=0.0)


def test_unsolvable_samples_are_marked():
    p = np.array([[0.0, 1.0, 2.0], [np.nan] * 3])
    tracks = unfurl.Tracks([0.0, 1.0], ["a", "a"], p, sigma=1e-3)
    assert list(tracks.status) == [unfurl.SampleStatus.GOOD, unfurl.SampleStatus.UNSOLVABLE]
    assert list(tracks.usable) == [True, False]
    assert list(tracks.samples("a")) == [0]
    with pytest.raises(KeyError, match="no mark 'b'"):
        tracks.samples("b")


def test_shared_factor_is_sample_axis_direction(sets, tmp_path):
    """The view's strides against the file's own layout, which h5py reads."""
    h5py = pytest.importorskip("h5py")
    n, k = 5, 4
    tracks = small_tracks(n)
    path = tmp_path / "tracks.h5"
    tracks.write(path)
    factor = np.arange(n * 3 * k, dtype=np.float32).reshape(n, 3, k)
    with h5py.File(path, "a") as file:
        file.attrs["shared_rank"] = k
        file.create_dataset("shared", data=factor).attrs["units"] = np.bytes_("m")
    again = unfurl.load(path)
    assert again.shared.shape == (n, 3, k)
    np.testing.assert_array_equal(again.shared, factor)


def test_survey_of_arrays_comes_back(tmp_path):
    rng = np.random.default_rng(1)
    u = rng.uniform(0, 2000, (20, 3))
    u[4, 1] = np.nan
    ids = [f"P{i}" for i in range(20)]
    p = rng.normal(size=(20, 3))
    survey = unfurl.Survey(ids, p, u, 0.05, cameras=["left", "middle", "r"], sigma=2e-4)
    for name in ("survey.h5", "survey.csv"):
        survey.write(tmp_path / name)
        again = unfurl.load(tmp_path / name)
        assert again.cameras == survey.cameras and again.id == ids
        np.testing.assert_allclose(again.p, p, rtol=1e-15)
        np.testing.assert_array_equal(again.u, u)
        assert np.isnan(again.s[4, 1])
        np.testing.assert_allclose(again.cov[:, [0, 3, 5]], 4e-8, rtol=1e-12)


def test_set_ups_come_back(tmp_path):
    names = ["door"] * 6 + ["wall"] * 4
    survey = unfurl.Survey(
        [f"P{i}" for i in range(10)], np.arange(30.0).reshape(10, 3), np.ones((10, 2)), 0.05,
        cameras=["left", "right"], sigma=2e-4, set_up=names)
    assert survey.set_up == names
    for name in ("survey.h5", "survey.csv"):
        survey.write(tmp_path / name)
        assert unfurl.load(tmp_path / name).set_up == names


def test_rig_comes_back(sets, tmp_path):
    rig = unfurl.load(sets / "deployment" / "rig.h5")
    rig.write(tmp_path / "rig.h5")
    again = unfurl.load(tmp_path / "rig.h5")
    np.testing.assert_array_equal(again.covariance, rig.covariance)
    assert again.verdict == rig.verdict and again.checks == rig.checks
    for a, b in zip(again.cameras, rig.cameras):
        np.testing.assert_array_equal(a.R_CW, b.R_CW)
        np.testing.assert_allclose(b.R_CW @ b.R_CW.T, np.eye(3), atol=1e-12)


def test_rotation_is_row_by_row(sets):
    """R_CW turns the way from the slit to the middle of the volume onto the optical axis' side."""
    rig = unfurl.load(sets / "deployment" / "rig.h5")
    low, high = rig.volume
    for camera in rig.cameras:
        x, y, z = camera.R_CW @ (0.5 * (low + high) - camera.p_WC)
        assert z > 5 * np.hypot(x, y)


def test_files_say_what_they_were_made_from(sets, tmp_path):
    h5py = pytest.importorskip("h5py")
    source = sets / "deployment" / "rig.h5"
    rig = unfurl.load(source)
    rig.write(tmp_path / "rig.h5")
    with h5py.File(tmp_path / "rig.h5") as file:
        inputs = file.attrs["inputs"]
    text = inputs.decode() if isinstance(inputs, bytes) else str(inputs)
    import hashlib

    assert str(source) in text
    assert hashlib.sha256(source.read_bytes()).hexdigest() in text


def test_an_input_that_changed_is_not_vouched_for(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "tracks.csv"
    small_tracks().write(path)
    tracks = unfurl.load(path)
    path.write_text(path.read_text() + "\n")
    tracks.write(tmp_path / "tracks.h5")
    with h5py.File(tmp_path / "tracks.h5") as file:
        assert "changed since it was read" in str(file.attrs["inputs"])


def test_load_knows_every_kind(sets, tmp_path, pendulum):
    deployment = sets / "deployment"
    assert isinstance(unfurl.load(deployment / "survey.h5"), unfurl.Survey)
    assert isinstance(unfurl.load(deployment / "points.csv"), unfurl.Survey)
    assert isinstance(unfurl.load(deployment / "rig.h5"), unfurl.Rig)
    assert isinstance(unfurl.load(deployment / "lab.toml"), unfurl.Lab)
    assert isinstance(unfurl.load(deployment / "study.toml"), unfurl.Study)
    assert isinstance(unfurl.load(str(deployment / "scene_suspension.toml")), unfurl.Scene)
    unfurl.simulate(pendulum, output=tmp_path / "run.h5", duration=0.1)
    assert isinstance(unfurl.load(tmp_path / "run.h5"), unfurl.Run)
    unfurl.modes(pendulum).write(tmp_path / "modes.h5")
    assert isinstance(unfurl.load(tmp_path / "modes.h5"), unfurl.Modes)


def test_reprs_say_what_matters(sets, pendulum):
    assert repr(small_tracks()) == (
        "<unfurl.Tracks: 40 samples of 2 marks in frame 'rig', 40 usable>"
    )
    assert "4 cameras, good" in repr(unfurl.load(sets / "deployment" / "rig.h5"))
    assert repr(pendulum) == "<unfurl.Scene 'pendulum': 1 body, 0 beams, 1 joint, 2 s>"
    assert "good, 2001 samples" in repr(unfurl.simulate(pendulum))


def test_tables(pendulum):
    pytest.importorskip("pandas")
    run = unfurl.simulate(pendulum)
    frame = unfurl.to_pandas(run)
    np.testing.assert_array_equal(frame["tip.x"].to_numpy(), run["tip.x"])
    assert frame.index.name == "t"
    tracks = small_tracks()
    by_mark = unfurl.to_pandas(tracks).groupby("mark").size()
    assert by_mark["tip"] == 20
    with pytest.raises(TypeError, match="no table"):
        unfurl.to_pandas(3)
