"""What the tests share: the shipped sets, and small records made by closed forms."""

import json
import os
import subprocess
import sys
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


def run(*words, cwd):
    """What the program says, as JSON."""
    done = subprocess.run([os.environ["UNFURL_PROGRAM"], *map(str, words), "--json"], cwd=cwd, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    return json.loads(done.stdout)


def small_tracks(n: int = 40) -> "unfurl.Tracks":
    t = 0.05 * np.arange(n)
    p = np.stack([np.cos(t), np.sin(t), 0.1 * t], axis=1)
    mark = ["tip" if i % 2 else "a longer name" for i in range(n)]
    return unfurl.Tracks(t, mark, p, sigma=1e-3)


# All values and attributes of a file, group by group; netCDF4 raises for what it cannot read.
READ_EVERYTHING = """
import sys
import netCDF4
import numpy as np
import xarray

def read(group):
    count = 0
    for variable in group.variables.values():
        np.asarray(variable[...])
        for name in variable.ncattrs():
            variable.getncattr(name)
        count += 1
    return count + sum(read(child) for child in group.groups.values())

def groups(group, path=""):
    yield path or None
    for name, child in group.groups.items():
        yield from groups(child, f"{path}/{name}" if path else name)

with netCDF4.Dataset(sys.argv[1]) as data:
    print(data.schema, read(data))
    paths = list(groups(data))
for path in paths:
    with xarray.open_dataset(sys.argv[1], group=path, engine="netcdf4") as part:
        part.load()
"""


def read_by_strangers(path: Path) -> tuple[str, int]:
    """Schema and number of variables of a file, as netCDF4 and xarray read it, to the last value.

    In a process of its own, which may take a minute: a layout that netCDF4 cannot read makes it
    crash or turn in a circle.
    """
    done = subprocess.run(
        [sys.executable, "-c", READ_EVERYTHING, path], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, f"{path.name}: {done.returncode}\n{done.stderr}"
    schema, count = done.stdout.split()
    return schema, int(count)
