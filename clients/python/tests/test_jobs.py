"""What users do with jobs, blocking and awaited."""

from __future__ import annotations

import asyncio
import gc
import threading
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gridfall


def test_a_run_shows_how_far_it_is(client: gridfall.Client, square: gridfall.Scene, monkeypatch: Any) -> None:
    shown = StringIO()
    monkeypatch.setattr("sys.stderr", shown)
    client.run(square, name="shown", overrides={"time.end": 0.01})
    assert "shown" in shown.getvalue() and "100%" in shown.getvalue() and "succeeded" in shown.getvalue()
    seen: list[str] = []
    client.run(square, overrides={"time.end": 0.01}, progress=lambda job: seen.append(job.status))
    assert seen[-1] == "succeeded"


def test_a_scene_is_judged_before_it_runs(client: gridfall.Client, square: gridfall.Scene) -> None:
    judged = client.validate(square)
    assert judged.valid and judged.estimate.frames == 6 and judged.estimate.explicit.steps > 0
    wrong = {**square.to_dict(), "gravity": [1], "time": {"end": -1}}
    for call in (client.validate, client.submit, client.run, client.keep_scene):
        with pytest.raises(gridfall.InvalidScene) as refused:
            call(wrong)
        error = refused.value
        assert {fault.pointer for fault in error.faults} == {"/scene/gravity", "/scene/time/end"}
        for fault in error.faults:
            assert fault.pointer in str(error) and fault.reason in str(error) and fault.remedy in str(error)
    with pytest.raises(TypeError, match="a scene is a Scene, a dict"):
        client.validate("scene.json")  # type: ignore[arg-type]


def test_element_tests_of_materials(client: gridfall.Client) -> None:
    sand = gridfall.scene.Preset(preset="dry-sand", friction_angle_degrees=40)
    curve = client.element_test(sand, "triaxial", confining_pressure=5e4, steps=50)
    assert len(curve) == 51 and curve["strain"][0] == 0
    # q = 2 p' sin φ/(1 − sin φ) at failure, without cohesion.
    sine = np.sin(np.radians(40))
    assert curve["q"][-1] == pytest.approx(5e4 * 2 * sine / (1 - sine), rel=1e-3)
    with pytest.raises(gridfall.ApiError, match="did you mean `steel`"):
        client.element_test({"preset": "steal"}, "uniaxial")


def test_jobs_are_found_over_pages(client: gridfall.Client, square: gridfall.Scene) -> None:
    made = [client.submit(square, tags=["page"], overrides={"time.end": 0.01, "seed": n}).id for n in range(3)]
    for each in made:
        client.wait(each)
    found = [job.id for job in client.jobs(tag="page", status=["succeeded"], page=2)]
    assert found == made[::-1]
    assert list(client.jobs(tag=["page", "none"])) == []


def test_cancel_wait_and_delete(client: gridfall.Client, endless: dict[str, Any]) -> None:
    job = client.submit(endless)
    with pytest.raises(gridfall.NotFinished, match="is still"):
        client.wait(job, timeout_s=0.3)
    states = client.watch(job)
    while next(states).progress.frames_written < 2:
        pass
    followed = client.follow(job)
    assert [next(followed).index for _ in range(2)] == [0, 1]
    with client.recording(job) as so_far:
        assert len(so_far.frames) >= 2 and so_far.frames[1].time == pytest.approx(0.01)
    assert client.frame_list(job).frames >= 2
    client.cancel(job)
    with pytest.raises(gridfall.JobFailed, match="canceled") as ended:
        client.wait(job)
    assert ended.value.code == "canceled" == client.wait(job, check=False).status
    client.delete(job)
    with pytest.raises(gridfall.NotFound) as missing:
        client.job(job)
    assert missing.value.code == "job_not_found"


def test_iterators_may_be_left_behind(client: gridfall.Client, endless: dict[str, Any]) -> None:
    """The garbage collector closes them at any moment, here while a call holds the connections."""
    job = client.submit(endless)
    left: list[Any] = [client.follow(job)]
    next(left[0])
    left.append(left)
    del left

    def collect() -> None:
        with client.http._transport._pool._optional_thread_lock:  # type: ignore[attr-defined]
            gc.collect()

    collector = threading.Thread(target=collect, daemon=True)
    collector.start()
    collector.join(30)
    assert not collector.is_alive()
    client.cancel(job)


def test_failures_have_a_code_and_a_remedy(client: gridfall.Client, square: gridfall.Scene) -> None:
    late = {"deadline": gridfall.Job.from_dict({"created_at": "2020-01-01T00:00:00Z"}).created_at}
    job = client.submit(square, **late)
    with pytest.raises(gridfall.JobFailed) as failed:
        client.wait(job)
    assert failed.value.code == "deadline" and failed.value.remedy and failed.value.remedy in str(failed.value)


def test_outputs(client: gridfall.Client, ran: gridfall.Result, tmp_path: Path) -> None:
    picture = client.thumbnail(ran.job)
    assert picture.startswith(b"\x89PNG") and picture.save(tmp_path / "a.png").read_bytes() == picture
    drawn = client.picture(ran.job, 0, size=(320, 200), color_by="speed", color_range=(0, 1))
    assert drawn.startswith(b"\x89PNG") and drawn != picture
    assert client.surface(ran.job, 0, form="glb").startswith(b"glTF")
    with pytest.raises(gridfall.ApiError, match="color_by"):
        client.picture(ran.job, 0, color_by="heat")
    points = client.points(ran.job, 2)
    assert points["position"] == pytest.approx(ran.frames[2].positions) and "velocity" in points
    assert len(client.points(ran.job, 2, max_points=5)["position"]) == 5
    assert client.export(ran.job, 0, form="ply").startswith(b"ply\n")
    state = client.state(ran.job)
    assert np.sort(state["x"], axis=0) == pytest.approx(np.sort(ran.frames[-1].positions, axis=0), abs=1e-5)
    assert "attempt 1" in client.log(ran.job)
    assert client.job_scene(ran.job).name == "cube"
    rows = client.diagnostics(ran.job)
    assert rows["frame"].dtype == np.int64 and rows["time_s"].dtype == np.float64
    assert rows["mass_kg"] == pytest.approx(rows["mass_kg"][0])


def test_kept_scenes_assets_and_reruns(client: gridfall.Client, square: gridfall.Scene) -> None:
    kept = client.keep_scene(square)
    job = client.wait(client.submit(kept, overrides={"time.end": 0.01}))
    assert job.progress.frames == 2
    again = client.wait(client.rerun(job, name="again", tags=[], overrides={"time.end": 0.02}))
    assert (again.name, again.progress.frames) == ("again", 3)
    assert client.rerun(client.wait(client.submit(square, priority=3)), priority=0).priority == 0
    on = client.wait(client.submit(square, start_from=again))
    fallen = client.state(again)["x"][:, 1].mean() - client.state(on)["x"][:, 1].mean()
    assert fallen == pytest.approx(10 * 0.02 * 0.05 + 0.5 * 10 * 0.05**2, rel=1e-3)
    points = b"ply\nformat ascii 1.0\nelement vertex 1\n" + b"".join(b"property float %c\n" % axis for axis in b"xyz")
    asset = client.upload(points + b"end_header\n10.5 -4.5 2.5\n")
    assert asset.kind == "ply" and asset.id.startswith("sha256:")
    assert asset in client.assets()
    assert kept.id in client.kept_scenes() and client.kept_scene(kept).name == "square"
    water = next(each for each in client.materials() if each.name == "water")
    assert water.material["model"] == "weakly-compressible-fluid" and len(water.values) > 3


def test_sweeps(client: gridfall.Client, square: gridfall.Scene) -> None:
    short = {"time.end": 0.01}
    results = client.run_sweep(square, grid={"gravity": [[0, -10], [0, -20]]}, overrides=short, progress=False)
    fallen = [each.frames[0].positions.mean(axis=0) - each.frames[-1].positions.mean(axis=0) for each in results]
    assert [each[1] for each in fallen] == pytest.approx([0.5 * 10 * 1e-4, 0.5 * 20 * 1e-4], rel=1e-2)
    sweep = client.sweep(square, list=[{"seed": 1}, {"seed": 2}], overrides={"time.end": 999}, name="long")
    assert client.cancel_sweep(sweep).id == sweep.id
    assert client.wait_sweep(sweep).ended
    assert {job.status for job in client.sweep_jobs(sweep)} == {"canceled"}
    assert [each.id for each in client.sweeps(page=1)][0] == sweep.id
    assert len({each.id for each in client.sweeps(page=1)}) >= 2


def test_results_of_sweeps_are_columns(client: gridfall.Client, square: gridfall.Scene) -> None:
    grid: dict[str, Any] = {"gravity": [[0, -10], [0, -20]], "solver.kernel": ["compact", "quadratic"]}
    short = {"time.end": 0.02}
    judged = client.validate_sweep(square, grid=grid, overrides=short, name="fall")
    assert judged.valid and len(judged.jobs) == 4 and judged.jobs[0].name.startswith("fall ")
    assert judged.estimate_s == pytest.approx(sum(job.estimate_s for job in judged.jobs))
    with pytest.raises(gridfall.InvalidScene, match="job 2 of 2"):
        client.validate_sweep(square, list=[{"seed": 1}, {"solver.cfl": -1}])
    sweep = client.wait_sweep(client.sweep(square, grid=grid, overrides=short, name="fall"))
    results = client.sweep_results(sweep)
    assert list(results["id"]) == [job.id for job in client.sweep_jobs(sweep)]
    assert set(results["status"]) == {"succeeded"} and results["fraction"] == pytest.approx(1)
    assert [each[1] for each in results["gravity"]] == [-10, -10, -20, -20]
    assert list(results["solver.kernel"]) == ["compact", "quadratic"] * 2
    fallen = -results["momentum_y.last"] / results["mass_kg.last"]
    assert fallen == pytest.approx([0.2, 0.2, 0.4, 0.4], rel=1e-3)
    # Frame 0 was at rest.
    assert results["max_speed.least"] == pytest.approx(0) and results["max_speed.most"].dtype == np.float64
    with pytest.raises(gridfall.NotFound):
        client.sweep_results("00000000-0000-0000-0000-000000000000")


def test_many_jobs_at_once(client: gridfall.Client, endless: dict[str, Any]) -> None:
    for _ in range(2):
        client.submit(endless, tags=["many"])
    assert client.cancel_jobs(tag="many") == 2
    for job in client.jobs(tag="many"):
        client.wait(job, check=False)
    assert client.cancel_jobs(tag=["many"], status=["running", "queued"]) == 0
    assert client.delete_jobs(tag="many", status="canceled") == 2
    with pytest.raises(gridfall.ApiError):
        client.delete_jobs()


def test_the_awaited_twin(url: str, square: gridfall.Scene, endless: dict[str, Any]) -> None:
    async def use() -> None:
        async with gridfall.AsyncClient(url) as client:
            judged, one, other = await asyncio.gather(
                client.validate(square), client.run(square, progress=False), client.run(square, progress=False)
            )
            assert judged.valid
            assert np.array_equal(one.frames[-1].positions, other.frames[-1].positions)
            assert one.job.id != other.job.id and len(one.diagnostics) == 6
            assert [frame.index async for frame in client.follow(one.job)] == list(range(6))
            assert one.job.id in [job.id async for job in client.jobs(name="square", page=1)]
            job = await client.submit(endless)
            async for state in client.watch(job):
                if state.progress.frames_written >= 1:
                    await client.cancel(job)
            assert (await client.job(job)).status == "canceled"
            with pytest.raises(gridfall.InvalidScene):
                await client.submit({})
            results = await client.run_sweep(square, list=[{"time.end": 0.01}, {"time.end": 0.02}], progress=False)
            assert [len(each.frames) for each in results] == [2, 3]

    asyncio.run(use())
    kinds = (gridfall.Client, gridfall.AsyncClient)
    one, other = ({name for name in vars(kind) if name[0] != "_"} for kind in kinds)
    assert one == other
