"""The tutorials, run as they are written."""

import os
import pathlib
import re
import subprocess

import pytest

FOLDER = pathlib.Path(os.environ["UNFURL_SOURCE_DIR"]) / "docs" / "tutorials"
BLOCK = re.compile(r"^```(\w+) ?(\S*)\n(.*?)^```$", re.M | re.S)
NAMES = sorted(p.stem for p in FOLDER.glob("*.md") if p.stem != "README")


def test_the_index_names_them_all():
    index = (FOLDER / "README.md").read_text()
    assert NAMES and all(f"({name}.md)" in index for name in NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_runs_as_written(name, tmp_path):
    folder, printed, commands = tmp_path, "", 0
    # Debian's Python first: the package is built for it.
    path = [os.path.dirname(os.environ["UNFURL_PROGRAM"]), "/usr/bin", os.environ["PATH"]]
    environment = {**os.environ, "PATH": os.pathsep.join(path)}
    for kind, file, text in BLOCK.findall((FOLDER / f"{name}.md").read_text()):
        if file:
            (folder / file).write_text(text)
        elif kind == "sh":
            # Its last folder is where the next block goes on.
            done = subprocess.run(["bash", "-ec", text + '\npwd > "$OLDEST/.where"'], cwd=folder, capture_output=True,
                                  text=True, env={**environment, "OLDEST": str(tmp_path)})
            assert done.returncode == 0, f"{text}\n{done.stderr}"
            folder = pathlib.Path((tmp_path / ".where").read_text().strip())
            printed = done.stdout
            commands += 1
        else:
            for line in text.splitlines():
                assert line in printed, f"'{line}' is not in:\n{printed}"
    assert commands >= 3
    assert [*tmp_path.rglob("*.html"), *tmp_path.rglob("*.png")], "no picture"
