"""What the tests share: the shipped sets, and small records made by closed forms."""

import os
from pathlib import Path

import numpy as np
import pytest

import unfurl

SOURCE = Path(os.environ["UNFURL_SOURCE_DIR"])
SETS = SOURCE / "data" / "sets"

# One rigid pendulum: closed forms know its period, and a fit its length.
PENDULUM = """
[scene]
name = "pendulum"
duration = 2.0
[gravity]
acceleration = [0.0, -9.81]
[body.rod]
mass = 1.0
inertia = 0.08333333333333333
[joint.pin]
inner = "ground"
outer = "rod"
outer_point = [-0.5, 0.0]
zero_angle = -1.5707963267948966
theta = 1.0
[mark.tip]
on = "rod"
point = [0.5, 0.0]
"""


@pytest.fixture
def sets() -> Path:
    return SETS


@pytest.fixture
def pendulum() -> "unfurl.Scene":
    return unfurl.parse_scene(PENDULUM, "pendulum")


def small_tracks(n: int = 40) -> "unfurl.Tracks":
    t = 0.05 * np.arange(n)
    p = np.stack([np.cos(t), np.sin(t), 0.1 * t], axis=1)
    mark = ["tip" if i % 2 else "a longer name" for i in range(n)]
    return unfurl.Tracks(t, mark, p, sigma=1e-3)
