"""What all tests of pages share: one browser, and one page of each kind."""

import os
import subprocess

import pytest

from browser import Browser

NAMES = ("simulate", "correlate", "plan", "modes", "calibrate", "check", "reconstruct", "live")
PROGRAM, CHROMIUM = os.environ["UNFURL_PROGRAM"], os.environ["UNFURL_CHROMIUM"]


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    one = Browser(CHROMIUM, str(tmp_path_factory.mktemp("profile")))
    yield one
    one.close()


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
    return {name: folder / f"{name}.html" for name in NAMES}
