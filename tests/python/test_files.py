"""Every file of ours, as strangers open it: netCDF4 and xarray, with times and names as coordinates."""

import textwrap

import numpy as np
import pytest
import xarray
from conftest import PENDULUM, SETS, read_by_strangers, small_tracks

import unfurl


def texts(values):
    return [str(v) for v in values]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    from test_fit import recorded, swing, unknowns

    folder = tmp_path_factory.mktemp("files")
    deployment = SETS / "deployment"
    lab = deployment / "lab.toml"
    unfurl.simulate(SETS / "bouncing_latch" / "scene.toml", output=folder / "run.h5")
    small_tracks().write(folder / "tracks.h5")
    unfurl.load(deployment / "rig.h5").write(folder / "rig.h5")
    survey = unfurl.expose_survey(deployment / "points.csv", lab)
    survey.write(folder / "survey.h5")
    u = np.arange(36.0).reshape(12, 3)
    u[3, 1] = np.nan  # not seen
    unfurl.Survey(
        [f"P{i}" for i in range(12)],
        np.arange(36.0).reshape(12, 3),
        u,
        0.05,
        cameras=["a", "a longer one", "\u00fcber"],
        sigma=1e-3,
    ).write(folder / "readings.h5")
    tracks = recorded()
    unfurl.fit(swing, tracks, unknowns(), finer=swing).write(folder / "fit.h5")
    one = unfurl.fit(
        lambda p, t: swing({**p, "decay": 0.35}, t), tracks, unknowns()[:1], profile_levels=[]
    )
    one.write(folder / "bare_fit.h5")
    unfurl.modes(unfurl.parse_scene(PENDULUM)).write(folder / "modes.h5")
    scene = deployment / "scene_suspension_4.toml"
    beams = unfurl.simulate(scene, duration=0.05, output=folder / "beams.h5")
    trial, _ = unfurl.expose(beams, lab, folder / "trial.h5")
    shared = unfurl.reconstruct(trial, deployment / "rig.h5")
    assert shared.shared.shape[2] > 0
    shared.write(folder / "shared.h5")
    shared.smooth().write(folder / "smoothed.h5")
    return folder


KINDS = {
    "run": "run",
    "beams": "run",
    "tracks": "tracks",
    "shared": "tracks",
    "smoothed": "tracks",
    "rig": "rig",
    "survey": "survey",
    "readings": "survey",
    "fit": "fit",
    "bare_fit": "fit",
    "modes": "modes",
    "trial": "trial",
}


@pytest.mark.parametrize("name", KINDS)
def test_netcdf4_and_xarray_read_everything(files, name):
    schema, count = read_by_strangers(files / f"{name}.h5")
    assert schema == f"unfurl/{KINDS[name]}"
    assert count > 3


def test_series_of_a_run_have_their_times(files):
    run = unfurl.load(files / "run.h5")
    with xarray.open_dataset(files / "run.h5", group="series", engine="netcdf4") as series:
        np.testing.assert_array_equal(series["t"], run.t)
        seen = set()
        for table in series.data_vars:
            assert series[table].dims == ("t", f"{table}_of"), table
            for column, owner in enumerate(texts(series[f"{table}_of"].values)):
                name = f"{owner}.{series[table].attrs['kind']}"
                np.testing.assert_array_equal(series[table][:, column], run[name])
                assert series[table].attrs["units"] == run.units(name)
                seen.add(name)
        assert seen == set(run.keys())
        at = series["x"].sel(x_of="tip").sel(t=1.0, method="nearest")
        assert float(at) == run["tip.x"][np.argmin(np.abs(run.t - 1.0))]
    with xarray.open_dataset(files / "run.h5", group="events", engine="netcdf4") as events:
        assert events["kind"].dims == ("t",)
        assert texts(events["kind"].values) == [e.kind for e in run.events]
        assert texts(events["where"].values) == [e.where for e in run.events]


def test_tracks_have_times_axes_and_names(files):
    tracks = small_tracks()
    with xarray.open_dataset(files / "tracks.h5", engine="netcdf4") as data:
        assert data["p"].dims == ("t", "axis") and data["cov"].dims == ("t", "component")
        np.testing.assert_array_equal(data["p"].sel(axis="y"), tracks.p[:, 1])
        np.testing.assert_array_equal(data["cov"].sel(component="zz"), tracks.cov[:, 5])
        assert data["status"].dims == data["mark"].dims == ("t",)
        assert texts(data["marks"].values) == tracks.marks  # of unlike length


def test_rig_has_the_cameras_names(files):
    rig = unfurl.load(files / "rig.h5")
    with xarray.open_dataset(files / "rig.h5", group="cameras", engine="netcdf4") as cameras:
        for camera in rig.cameras:
            assert float(cameras["f"].sel(name=camera.name)) == camera.f
        terms = cameras["terms"].sel(name=rig.cameras[1].name)
        np.testing.assert_array_equal(terms, rig.cameras[1].terms)


def test_covariance_of_a_rig_has_dimensions_of_its_own(files):
    """Without them netCDF4 takes any of that length: the letters of a reason, say."""
    rig = unfurl.load(files / "rig.h5")
    with xarray.open_dataset(files / "rig.h5", engine="netcdf4") as data:
        assert data["covariance"].dims == ("parameter", "parameter_2")
        np.testing.assert_array_equal(data["covariance"], rig.covariance)


def test_survey_and_trial_have_names(files):
    survey = unfurl.load(files / "survey.h5")
    with xarray.open_dataset(files / "survey.h5", engine="netcdf4") as data:
        assert data["p"].dims[0] == "id"
        point = survey.id[7]
        np.testing.assert_array_equal(data["p"].sel(id=point), survey.p[7])
    trial = unfurl.load(files / "trial.h5")
    with xarray.open_dataset(files / "trial.h5", engine="netcdf4") as data:
        t, _, counts = trial.lines(0, len(trial))
        np.testing.assert_array_equal(data["t"], t)
        assert data["slot"].dims == ("t",)
        np.testing.assert_array_equal(data["lines"], counts)


def test_samples_of_a_fit_have_their_times(files):
    fit = unfurl.load(files / "fit.h5")
    with xarray.open_dataset(files / "fit.h5", group="samples", engine="netcdf4") as samples:
        assert samples["measured"].dims == ("t", "axis")
        np.testing.assert_array_equal(samples["t"], fit.t)
        np.testing.assert_array_equal(samples["simulated"], fit.simulated)
    with xarray.open_dataset(files / "fit.h5", group="parameters", engine="netcdf4") as parameters:
        assert texts(parameters["unit"].sel(name="decay").values.reshape(1)) == ["1/s"]


def test_shared_factor_has_times_and_axes(files):
    tracks = unfurl.load(files / "shared.h5")
    with xarray.open_dataset(files / "shared.h5", engine="netcdf4") as data:
        assert data["shared"].dims[:2] == ("t", "axis")
        np.testing.assert_allclose(data["shared"], tracks.shared, rtol=1e-6)


def test_scales_are_those_of_the_specification(files):
    """As HDF5's own library sees them."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(files / "run.h5") as file:
        column = file["series/x"]
        time = file["series/t"]
        assert column.dims[0][0] == time and h5py.h5ds.is_scale(time.id)
        np.testing.assert_array_equal(time, file["t"])
        users = {file[reference].name for reference, _ in time.attrs["REFERENCE_LIST"]}
        series = file["series"]
        tables = {f"/series/{name}" for name in series if "kind" in series[name].attrs}
        assert "/series/x" in users and users == tables


def test_a_trial_written_as_the_documentation_says(tmp_path, monkeypatch):
    """The program of docs/formats.md, by h5py alone."""
    page = (SETS.parent.parent / "docs" / "formats.md").read_text()
    program = page.split("### A trial of your own, in Python\n\n")[1].split("\n## ")[0]
    monkeypatch.chdir(tmp_path)
    names = {
        "t": np.arange(20) / 1000.0,
        "slot": np.arange(20) % 5,
        "counts": np.full((20, 4, 2235), 100, np.uint16),
    }
    exec(textwrap.dedent(program), names)
    trial = unfurl.load("trial.h5")
    assert trial.cameras == ["door", "window", "bench", "crane"] and trial.lit[-1] == "dark"
    t, lit, counts = trial.lines(0, len(trial))
    np.testing.assert_array_equal(t, names["t"])
    np.testing.assert_array_equal(lit, names["slot"])
    np.testing.assert_array_equal(counts, names["counts"])


def test_text_of_variable_length_is_refused_with_the_remedy(tmp_path):
    import h5py

    with h5py.File(tmp_path / "trial.h5", "w") as file:
        file.attrs["schema"] = "unfurl/trial"  # h5py makes it of variable length
    with pytest.raises(unfurl.Error, match="numpy.bytes_"):
        unfurl.load(tmp_path / "trial.h5")


def test_records_as_datasets(files):
    run = unfurl.load(files / "run.h5")
    data = unfurl.to_xarray(run)
    assert data["tip.x"].attrs["units"] == "m"
    np.testing.assert_array_equal(data["t"], run.t)
    tracks = unfurl.to_xarray(small_tracks())
    assert tracks["p"].dims == ("t", "axis") and list(tracks["axis"].values) == ["x", "y", "z"]
