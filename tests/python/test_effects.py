"""Which effects count, and what to measure next: Python says what the program says."""

import numpy as np
import pytest

import unfurl
from conftest import PENDULUM, SETS, run

SCENE = SETS / "bouncing_latch" / "scene.toml"


STUDY = """
[study]
scene = "pendulum.toml"
[[trial]]
tracks = "tracks.h5"
[parameter.damping]
keys = ["joint.pin.damper.damping"]
start = 0.03
bounds = [0.001, 0.3]
unit = "N m s/rad"
[profile]
levels = []
"""


def recorded_pendulum(folder):
    """A study of a damped pendulum, its tip recorded to 1 mm, and held before it is let go."""
    (folder / "pendulum.toml").write_text(PENDULUM + "[joint.pin.damper]\ndamping = 0.04\n")
    (folder / "study.toml").write_text(STUDY)
    motion = unfurl.simulate(folder / "pendulum.toml", rate=100)
    x, y = motion["tip.x"], motion["tip.y"]
    held = 40
    p = np.stack([np.r_[np.full(held, x[0]), x], np.r_[np.full(held, y[0]), y], np.zeros(held + len(x))], axis=1)
    p += np.random.default_rng(3).normal(0.0, 1e-3, p.shape)
    t = 0.01 * np.arange(len(p))
    unfurl.Tracks(t, ["tip"] * len(t), p, sigma=1e-3).write(folder / "tracks.h5")
    return folder / "study.toml"


def test_effects_of_a_scene_are_the_programs(tmp_path):
    told = run("effects", SCENE, "--sigma", "1mm", "--duration", 1.2, "-o", "reduced.toml", cwd=tmp_path)
    found = unfurl.effects(SCENE, sigma=1e-3, duration=1.2)
    assert (found.floor, found.left_out, found.reduced_rms) == (
        told["floor"],
        told["left_out"],
        told["reduced_rms"],
    )
    assert found.duration == 1.2
    for effect, row in zip(found.effects, told["effects"], strict=True):
        assert (effect.name, effect.there, effect.set) == (row["name"], row["there"], row["set"])
        assert effect.verdict == row["verdict"]
        if not effect.message:
            assert (effect.mark, effect.rms, effect.largest) == (row["mark"], row["rms"], row["largest"])
    assert any(effect.verdict == "needed" for effect in found.effects)
    # The reduced scene as a file, and by its overrides.
    found.write(tmp_path / "again.toml")
    lines = [(tmp_path / name).read_text().splitlines()[1:] for name in ("again.toml", "reduced.toml")]
    assert lines[0] == lines[1]
    a = unfurl.simulate(tmp_path / "again.toml", duration=0.5)
    b = unfurl.simulate(SCENE, set=found.set, duration=0.5)
    np.testing.assert_array_equal(a["tip.x"], b["tip.x"])


def test_effects_and_design_of_a_trial_are_the_programs(tmp_path):
    study = recorded_pendulum(tmp_path)
    told = run("effects", study, cwd=tmp_path)
    found = unfurl.effects_study(study)
    assert found.usable and found.explains == told["explains"] and found.left_out == told["left_out"]
    for effect, row in zip(found.effects, told["effects"], strict=True):
        assert (effect.name, effect.verdict) == (row["name"], row["verdict"])
        if effect.fitted:
            assert (effect.deviance, effect.change) == (row["deviance"], row["change"])
            assert effect.shifts == row.get("shifts", {})
            assert effect.held_out == (row["held_out"]["gain"], row["held_out"]["sigma"])
    damping = next(effect for effect in found.effects if "damp" in effect.name and effect.there)
    assert damping.verdict == "needed" and damping.probability > 0.99
    told = run("design", study, cwd=tmp_path)
    design = unfurl.design(study, stretches=8)
    assert design.usable and design.advice == told["advice"] and design.wanted == told["wanted"]
    for name, row in told["parameters"].items():
        assert (design.sigma[name], design.priors[name]) == (row["sigma"], row["prior"])
    for part, row in zip(design.times, told["tells"]["times"], strict=True):
        assert (part.name, part.readings, part.share) == (row["name"], row["readings"], row["share"])
    assert design.schedule[0].together == told["again"]["sigma_together"]
    # The same trial once more: as good as twice the data, but for what was known beforehand.
    assert design.schedule[0].factor == pytest.approx(np.sqrt(0.5), rel=0.05)
    assert design.fit.status == "converged"
    for thing in (found, damping, design, design.times[0], design.schedule[0]):
        assert repr(thing).startswith(f"<unfurl.{type(thing).__name__}"), repr(thing)


def test_what_makes_no_sense(tmp_path):
    with pytest.raises(unfurl.Error, match="sigma"):
        unfurl.effects(SCENE, sigma=-1.0)
    with pytest.raises(TypeError, match="the path of a scene"):
        unfurl.effects(unfurl.read_scene(SCENE))
    study = recorded_pendulum(tmp_path)
    with pytest.raises(unfurl.Error, match="wanted"):
        unfurl.design(study, wanted=["no such"])
    with pytest.raises(unfurl.Error, match="budget"):
        unfurl.effects_study(study, budget=-1.0)
