"""The package as a whole: generated parts are current, types hold, the program is found, the notebook runs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import gridfall

HERE = Path(__file__).resolve().parents[1]
USER = """
import gridfall

def blocking(g: gridfall.Client) -> None:
    reveal_type(g.run({}).frames[0].positions)
    for job in g.jobs(status="queued"):
        reveal_type(job)
    g.submit({}, nam="x")

async def awaited(g: gridfall.AsyncClient) -> None:
    reveal_type(await g.submit({}))
    gridfall.scene.Domain(min=[0, 0], max=[1, 1], dx="1")
"""


def test_generated_modules_are_current() -> None:
    ran = subprocess.run([sys.executable, HERE / "generate.py", "--check"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


def test_types_hold(tmp_path: Path) -> None:
    cache = Path(os.environ.get("GRIDFALL_MYPY_CACHE", tmp_path))
    (tmp_path / "user.py").write_text(USER)
    for files, expected in ([], 0), ([tmp_path / "user.py"], 1):
        command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", cache, *files]
        ran = subprocess.run(command, cwd=HERE, capture_output=True, text=True)
        assert ran.returncode == expected, ran.stdout
    told = ["Unexpected keyword argument \"nam\"", "\"dx\" to \"Domain\" has"]
    for said in ["\"numpy.ndarray[", "\"gridfall.models.Job\"", *told]:
        assert said in ran.stdout, ran.stdout
    assert "Found 2 errors" in ran.stdout, ran.stdout


def test_licences_are_the_projects() -> None:
    for name in ("LICENSE-MIT", "LICENSE-APACHE"):
        assert (HERE / name).read_text() == (HERE.parents[1] / name).read_text()


def test_the_version_is_the_programs() -> None:
    said = subprocess.run([gridfall.program(), "--version"], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["gridfall", gridfall.__version__]


def test_where_the_program_is_looked_for(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setenv("GRIDFALL_BINARY", str(tmp_path / "none"))
    with pytest.raises(gridfall.ProgramError, match="which is not a program"):
        gridfall.program()
    monkeypatch.delenv("GRIDFALL_BINARY")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(gridfall.ProgramError, match="install a wheel that carries it"):
        gridfall.program()
    (tmp_path / "gridfall").write_text("#!/bin/sh\n")
    (tmp_path / "gridfall").chmod(0o755)
    assert gridfall.program() == tmp_path / "gridfall"


def test_a_server_that_does_not_start_says_why(tmp_path: Path) -> None:
    with pytest.raises(gridfall.ProgramError, match="does not start: .*--no-such-option"):
        with gridfall.local(arguments=["--no-such-option"]):
            pass


def test_a_server_ends_with_its_client() -> None:
    g = gridfall.local(arguments=["--backend", "cpu"])
    url, other = g.url, gridfall.local(arguments=["--backend", "cpu"])
    assert url != other.url and g.ready().status == "ready"
    g.close()
    with gridfall.Client(url, retries=0) as gone, pytest.raises(gridfall.ServerUnreachable):
        gone.ready()
    command = [sys.executable, "-c", "import gridfall; print(gridfall.local().url)"]
    forgotten = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.strip()
    with gridfall.Client(forgotten, retries=0) as gone, pytest.raises(gridfall.ServerUnreachable):
        gone.ready()
    assert other.ready().status == "ready"
    other.close()


def test_three_lines_and_a_data_directory(tmp_path: Path, square: gridfall.Scene) -> None:
    with gridfall.local(arguments=["--backend", "cpu"], data_dir=tmp_path / "data") as g:
        g.run(square, progress=False).recording.save(tmp_path / "x.mcap")
    with gridfall.local(arguments=["--backend", "cpu"], data_dir=tmp_path / "data") as g:
        [job] = g.jobs()
    assert (job.name, len(gridfall.Recording(tmp_path / "x.mcap").frames)) == ("square", 6)


@pytest.mark.parametrize("notebook", sorted((HERE / "examples").glob("*.ipynb")), ids=lambda file: file.stem)
def test_notebooks_run(notebook: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for number, cell in enumerate(json.loads(notebook.read_text())["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{notebook.name}[{number}]", "exec"), names)
    assert len(gridfall.Recording(tmp_path / "splash.mcap").frames) == len(names["result"].frames) > 10
