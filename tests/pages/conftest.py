"""What all tests of pages share: one browser, and one page of each kind."""

import cmath
import math
import os
import random
import subprocess

import pytest

from browser import Browser

NAMES = ("simulate", "correlate", "plan", "modes", "calibrate", "check", "reconstruct", "live", "wand",
         "effects", "cost", "campaign", "ambient", "moment", "fit", "design")
# Of a page there is most to see on a desk, and most to go wrong on a telephone in the dark.
WHERE = {"desk": {"width": 1100, "dark": False}, "telephone, dark": {"width": 390, "dark": True}}
PROGRAM, CHROMIUM = os.environ["UNFURL_PROGRAM"], os.environ["UNFURL_CHROMIUM"]


def pytest_collection_modifyitems(items):
    """Tests of one page in one place after one another: they share its loading (Browser.look)."""
    def place(item):
        parameters = item.callspec.params if hasattr(item, "callspec") else {}
        return [str(parameters.get(what, "")) for what in ("name", "where")]
    items.sort(key=place)


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    one = Browser(CHROMIUM, str(tmp_path_factory.mktemp("profile")))
    yield one
    one.close()


def vibration(channels=6, samples=20000, step=0.005):
    """A table of what noise drives: two modes of 1.3 and 9.7 Hz, seen by each channel in parts of its own."""
    chance = random.Random(1)
    parts = [[chance.gauss(0, 1) for _ in range(channels)] for _ in range(2)]
    swings = []
    for frequency, damping in ((1.3, 0.01), (9.7, 0.02)):
        root = cmath.exp(2j * math.pi * frequency * step * (1 - damping ** 2) ** 0.5 -
                         damping * 2 * math.pi * frequency * step)
        swing = [0.0, 0.0]
        for _ in range(samples):
            swing.append(2 * root.real * swing[-1] - abs(root) ** 2 * swing[-2] + chance.gauss(0, 1))
        swings.append(swing[2:])
    head = "t [s]," + ",".join(f"a{c} [m/s^2]" for c in range(channels))
    rows = (f"{k * step:.3f}," + ",".join(f"{parts[0][c] * swings[0][k] + parts[1][c] * swings[1][k]:.5g}"
                                          for c in range(channels)) for k in range(samples))
    return head + "\n" + "\n".join(rows) + "\n"


PENDULUM = """
[scene]
name = "pendulum"
duration = 5.0
[gravity]
acceleration = [0.0, -9.81]
[body.arm]
mass = 1.0
inertia = 0.0833
[joint.hinge]
inner = "ground"
outer = "arm"
outer_point = [-0.5, 0.0]
zero_angle = -1.5707963267948966
theta = 0.02
[joint.hinge.damper]
damping = 0.1
"""
STUDY = """
[study]
scene = "pendulum.toml"
[trial.channel.encoder]
file = "encoder.csv"
column = "angle"
quantity = "hinge.theta"
[parameter.damping]
keys = ["joint.hinge.damper.damping"]
start = 0.08
bounds = [0.01, 0.5]
unit = "N m s"
[parameter.gravity]
keys = ["gravity.acceleration[1]"]
start = -9.6
bounds = [-11.0, -8.0]
unit = "m/s^2"
"""


def swings(step=0.01, duration=5.0):
    """What an encoder reads of the pendulum of PENDULUM, in closed form for small angles."""
    chance = random.Random(2)
    inertia = 0.0833 + 0.25
    decay = 0.5 * 0.1 / inertia
    rate = math.sqrt(0.5 * 9.81 / inertia - decay ** 2)
    rows = ((t, 0.02 * math.exp(-decay * t) * (math.cos(rate * t) + decay / rate * math.sin(rate * t)))
            for t in (k * step for k in range(int(duration / step))))
    return "t [s],angle [rad]\n" + "".join(f"{t:.3f},{angle + chance.gauss(0, 1e-4):.7f}\n" for t, angle in rows)


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")

    def run(*arguments):
        subprocess.run([PROGRAM, *arguments, "--quiet"], cwd=folder, check=True)

    for kind in ("boom", "study", "rig"):
        run("new", kind)
    run("simulate", "boom/scene.toml", "-o", "boom.h5", "--report", "simulate.html")
    run("simulate", "study/scene.toml", "-o", "drawn.h5")
    run("correlate", "study/tracks.csv", "drawn.h5", "--report", "correlate.html")
    run("plan", "rig/lab.toml", "--report", "plan.html", "--columns", "9", "--layers", "2")
    run("expose", "--survey", "rig/points.csv", "--lab", "rig/lab.toml", "-o", "survey.h5")
    run("calibrate", "survey.h5", "-o", "rig.h5", "--report", "calibrate.html")
    run("check", "rig.h5", "survey.h5", "--report", "check.html")
    run("expose", "drawn.h5", "--lab", "rig/lab.toml", "-o", "trial.h5")
    run("reconstruct", "trial.h5", "--rig", "rig.h5", "-o", "tracks.h5", "--report", "reconstruct.html")
    run("reconstruct", "trial.h5", "--live", "--rig", "rig.h5", "--report", "live.html")
    run("modes", "boom/scene.toml", "--count", "3", "--report", "modes.html")
    run("expose", "--survey", "rig/bar.csv", "--lab", "rig/lab.toml", "-o", "bar.h5")
    run("convert", "bar.h5", "bar.csv")
    run("calibrate", "--wand", "bar.csv", "--bar", "0.6m+-0.1mm", "--layout", "rig/lab.toml", "-o", "by_bar.h5",
        "--report", "wand.html")
    run("effects", "boom/scene.toml", "--sigma", "0.2mm", "--duration", "1", "--report", "effects.html")
    run("cost", "boom/scene.toml", "--duration", "1", "--order", "1", "--segments", "2", "4", "--rtol", "1e-3", "--report",
        "cost.html")
    run("new", "campaign")
    run("campaign", "campaign/plan.toml", "-o", "runs.h5", "--report", "campaign.html")
    (folder / "pendulum.toml").write_text(PENDULUM)
    (folder / "study.toml").write_text(STUDY)
    (folder / "encoder.csv").write_text(swings())
    run("fit", "study.toml", "-o", "fit.h5", "--report", "fit.html")
    run("design", "study.toml", "--report", "design.html")
    (folder / "ambient.csv").write_text(vibration())
    run("correlate", "ambient.csv", "--modes", "ambient", "--report", "ambient.html")
    run("simulate", "boom/scene.toml", "--duration", "1e-9", "-o", "moment.h5", "--report", "moment.html")
    return {name: folder / f"{name}.html" for name in NAMES}
