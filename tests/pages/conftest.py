"""What all tests of pages share: one browser, and one page of each kind."""

import cmath
import math
import os
import random
import subprocess

import pytest

from browser import Browser

NAMES = ("simulate", "correlate", "plan", "modes", "calibrate", "check", "reconstruct", "live", "wand",
         "effects", "cost", "campaign", "ambient", "moment")
PROGRAM, CHROMIUM = os.environ["UNFURL_PROGRAM"], os.environ["UNFURL_CHROMIUM"]


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
    (folder / "ambient.csv").write_text(vibration())
    run("correlate", "ambient.csv", "--modes", "ambient", "--report", "ambient.html")
    run("simulate", "boom/scene.toml", "--duration", "1e-9", "-o", "moment.h5", "--report", "moment.html")
    return {name: folder / f"{name}.html" for name in NAMES}
