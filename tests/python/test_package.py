"""The package itself: stubs that are true, docstrings, examples and the programs of docs/python.md."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import unfurl

SOURCE = Path(os.environ["UNFURL_SOURCE_DIR"])


def python(*words, cwd):
    done = subprocess.run([sys.executable, *map(str, words)], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_types_are_consistent(tmp_path):
    package = Path(unfurl.__file__).parent
    cache = f"--cache-dir={tmp_path / 'cache'}"
    examples = sorted((SOURCE / "examples").glob("*.py"))
    python("-m", "mypy", "--strict", "--ignore-missing-imports", cache, package, *examples, cwd=tmp_path)


def test_everything_has_a_docstring():
    for name in unfurl.__all__:
        if not name.startswith("__"):
            assert getattr(unfurl, name).__doc__, name


def test_names_are_the_packages():
    assert unfurl.Rig.__module__ == "unfurl"
    assert repr(unfurl.Error) == "<class 'unfurl.Error'>"


def programs_of(page: Path):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("number", range(len(programs_of(SOURCE / "docs" / "python.md"))))
def test_programs_of_the_documentation_run(tmp_path, number):
    """Each on its own, as it stands, in a folder with the files of the shipped set."""
    for file in (SOURCE / "data" / "sets" / "deployment").iterdir():
        (tmp_path / file.name).symlink_to(file)
    (tmp_path / "latch.toml").symlink_to(SOURCE / "data" / "sets" / "bouncing_latch" / "scene.toml")
    program = tmp_path / "program.py"
    program.write_text(programs_of(SOURCE / "docs" / "python.md")[number])
    python(program, cwd=tmp_path)
