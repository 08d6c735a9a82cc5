"""Campaigns from Python: a sliding block in closed form, and the program's own record."""

import os
import subprocess

import numpy as np
import pytest

import unfurl

SCENE = """
[scene]
name = "block"
duration = 2.0
[body.block]
mass = 2.0
inertia = 0.1
velocity = [0.7, 0, 0]
[event.passes]
when = "block.x"
level = 1.0
"""

PLAN = """
[campaign]
name = "blocks"
runs = 200
[job]
scene = "block.toml"
rate = 50
[variable.v]
keys = ["body.block.velocity[0]"]
uniform = [0.25, 1.0]
[response.x]
quantity = "block.x"
of = "final"
[response.passed]
event = "watch"
[response.when]
event = "watch"
of = "time"
"""


@pytest.fixture
def plan(tmp_path):
    (tmp_path / "block.toml").write_text(SCENE)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path / "plan.toml"


def test_runs_are_those_of_the_motion(plan):
    campaign = unfurl.campaign(plan)
    assert campaign.usable and campaign.runs == 200 and campaign.failures == []
    v, x = campaign.variables["v"], campaign.responses["x"]
    assert np.allclose(x, 2 * v, atol=1e-9)
    assert np.array_equal(campaign.responses["passed"] == 1, v > 0.5)
    assert np.array_equal(np.isnan(campaign.responses["when"]), v <= 0.5)
    low, high = campaign.answers["responses"]["passed"]["probability"]["interval"]
    assert low <= 2 / 3 <= high
    assert any("have no when" in note for note in campaign.notes)
    assert not x.flags.writeable


def test_workers_and_the_program_give_the_same(plan, tmp_path):
    one = unfurl.campaign(plan, workers=1)
    many = unfurl.campaign(str(plan), workers=3)
    words = [os.environ["UNFURL_PROGRAM"], "campaign", "plan.toml", "-o", "runs.h5", "--quiet"]
    subprocess.run(words, cwd=tmp_path, check=True)
    stored = unfurl.load(tmp_path / "runs.h5")
    for name in ("x", "passed", "when"):
        assert np.array_equal(one.responses[name], many.responses[name], equal_nan=True)
        assert np.array_equal(one.responses[name], stored.responses[name], equal_nan=True)
    assert np.array_equal(one.variables["v"], stored.variables["v"])
    assert one.answers == stored.answers


def test_what_is_wrong_is_said(plan):
    with pytest.raises(unfurl.Error, match="block.x"):
        unfurl.campaign(plan, set={"response.x.quantity": "blok.x"})
    with pytest.raises(unfurl.Error, match="unfurl.campaign"):
        unfurl.load(plan)
    with pytest.raises(unfurl.Error, match="earlier runs"):
        unfurl.campaign(plan, set={"campaign.design": "random", "campaign.until": "mean(x) +- 1%"})


def test_as_a_table(plan):
    pytest.importorskip("pandas")
    frame = unfurl.to_pandas(unfurl.campaign(plan, set={"campaign.runs": 20}))
    assert list(frame.columns) == ["v", "x", "passed", "when"]
    assert len(frame) == 20
