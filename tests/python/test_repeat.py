"""Trials that differ, from Python: the program's numbers, and what made them."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import unfurl

SCENE = Path(os.environ["UNFURL_SOURCE_DIR"]) / "data" / "sets" / "bouncing_latch" / "scene.toml"
SIGMA = 2e-4  # of a mark's coordinate [m]
STIFFNESS = [0.211, 0.217, 0.226]  # of each deployment's spring [N m/rad]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("repeat")
    rng = np.random.default_rng(3)
    trials = ""
    for i, stiffness in enumerate(STIFFNESS):
        run = unfurl.simulate(
            SCENE, duration=1.2, rtol=1e-9, set={"joint.hinge.spring.stiffness": stiffness}
        )
        rows = ["# frame: rig", "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],"
                "cyy [m^2],cyz [m^2],czz [m^2]"]
        for k in range(0, len(run.t), 5):
            x, y, z = np.array([run["tip.x"][k], run["tip.y"][k], 0.0]) + rng.normal(0, SIGMA, 3)
            v = SIGMA**2
            rows.append(f"{run.t[k]!r},tip,{x!r},{y!r},{z!r},{v},0,0,{v},0,{v}")
        (folder / f"t{i}.csv").write_text("\n".join(rows) + "\n")
        trials += f'[[trial]]\nname = "t{i}"\ntracks = "t{i}.csv"\n'
    (folder / "study.toml").write_text(
        f'[study]\nscene = "{SCENE}"\n{trials}[parameter.stiffness]\n'
        'keys = ["joint.hinge.spring.stiffness"]\nunit = "N m/rad"\nstart = 0.22\n'
        "bounds = [0.1, 0.4]\n[profile]\nlevels = []\n"
    )
    return folder / "study.toml"


def test_scatter_is_that_of_the_program(study):
    fit = unfurl.fit_study(study, repeat=True, output=study.parent / "fit.h5")
    assert fit.usable
    told = subprocess.run(
        [os.environ["UNFURL_PROGRAM"], "fit", "study.toml", "--repeat", "-o", "program.h5", "--json"],
        cwd=study.parent, capture_output=True, text=True, check=True,
    )
    program = json.loads(told.stdout)["repeat"]
    one, theirs = fit.repeat.parameters[0], program["parameters"][0]
    assert one.scatter == theirs["scatter"]
    assert one.scatter_interval == (theirs["scatter_low95"], theirs["scatter_high95"])
    assert one.next_interval == (theirs["next_low95"], theirs["next_high95"])
    assert fit["stiffness"].value == theirs["mean"]
    # And what made the trials lies where it says: each by many of its own errors.
    assert fit.repeat.trials == ["t0", "t1", "t2"]
    assert fit.repeat.estimate.shape == (1, 3)
    np.testing.assert_allclose(fit.repeat.estimate[0], STIFFNESS, rtol=5e-3)
    low, high = one.scatter_interval
    assert low < np.std(STIFFNESS, ddof=1) < high
    assert fit.repeat.middle.shape == fit.repeat.low.shape == (len(fit.repeat.t), 3)
    again = unfurl.load(study.parent / "fit.h5")
    assert again.repeat.parameters[0].scatter == one.scatter


def test_one_value_for_all_where_it_is_asked_for(study):
    assert unfurl.fit_study(study).repeat is None
    with pytest.raises(unfurl.Error, match="compare"):
        unfurl.fit_study(study, repeat=True, compare=True)
