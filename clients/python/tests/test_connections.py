"""Lost connections and busy servers: nothing is done twice, nothing is given up too early."""

from __future__ import annotations

import asyncio
import subprocess
import time
from pathlib import Path

import httpx
import pytest

import gridfall

from .flaky import flaky


def test_a_submission_whose_answer_is_lost_is_accepted_once(client: gridfall.Client, square: gridfall.Scene) -> None:
    with flaky(client.url, [0, 20]) as way, gridfall.Client(way.url) as lost:
        job = lost.submit(square, name="once", overrides={"time.end": 0.01})
    keys = [line for head in way.requests for line in head.split("\r\n") if line.startswith("idempotency-key")]
    assert len(keys) == 3 and len(set(keys)) == 1
    assert [each.id for each in client.jobs(name="once")] == [job.id]


def test_a_rerun_and_a_sweep_whose_answers_are_lost_are_accepted_once(
    client: gridfall.Client, ran: gridfall.Result, square: gridfall.Scene
) -> None:
    with flaky(client.url, [0]) as way, gridfall.Client(way.url) as lost:
        job = lost.rerun(ran.job, name="again")
    assert len(way.requests) == 2
    assert [each.id for each in client.jobs(name="again")] == [job.id]
    with flaky(client.url, [0]) as way, gridfall.Client(way.url) as lost:
        lost.sweep(square, grid={"seed": [1, 2]}, overrides={"time.end": 0.01}, name="twice")
    assert len(way.requests) == 2
    assert len(list(client.jobs(name="twice*"))) == 2


def test_what_may_not_be_repeated_is_not(client: gridfall.Client, square: gridfall.Scene) -> None:
    job = client.run(square, overrides={"time.end": 0.01}).job
    with flaky(client.url, [0]) as way, gridfall.Client(way.url) as lost:
        with pytest.raises(gridfall.ServerUnreachable, match="it may have been accepted, so look before"):
            lost.delete(job)
    assert len(way.requests) == 1


def test_a_download_goes_on_where_it_broke_off(ran: gridfall.Result, url: str, tmp_path: Path) -> None:
    whole = ran.recording.path.read_bytes()
    # The first connection also carries the question for the job.
    with flaky(url, [len(whole) // 2, len(whole) // 4]) as way, gridfall.Client(way.url) as lost:
        recording = lost.recording(ran.job, to=tmp_path / "a.mcap")
    assert recording.path.read_bytes() == whole and sorted(tmp_path.iterdir()) == [recording.path]
    resumed = [head for head in way.requests if "\r\nrange: bytes=" in head]
    assert len(resumed) == 2 and all("\r\nif-range: \"" in head for head in resumed)


def test_another_program_goes_on_with_a_download(ran: gridfall.Result, url: str, tmp_path: Path) -> None:
    whole = ran.recording.path.read_bytes()
    target = tmp_path / "a.mcap"
    with flaky(url, [len(whole) // 2]) as way, gridfall.Client(way.url, retries=0) as lost:
        with pytest.raises(gridfall.ServerUnreachable):
            lost.recording(ran.job, to=target)
    so_far = (tmp_path / "a.mcap.part").stat().st_size
    assert 0 < so_far < len(whole)
    with flaky(url, []) as way:

        async def go_on() -> None:
            async with gridfall.AsyncClient(way.url) as other:
                await other.recording(ran.job, to=target)

        asyncio.run(go_on())
    assert target.read_bytes() == whole
    assert f"range: bytes={so_far - 1}-" in way.requests[-1]


def test_a_download_that_only_lacks_its_name(ran: gridfall.Result, url: str, tmp_path: Path) -> None:
    target, whole = tmp_path / "a.mcap", ran.recording.path.read_bytes()
    with gridfall.Client(url) as client:
        etag = client.http.head(f"/v1/jobs/{ran.job.id}/recording.mcap").headers["etag"]
        (tmp_path / "a.mcap.part").write_bytes(whole)
        (tmp_path / "a.mcap.part.etag").write_text(etag)
        client.recording(ran.job, to=target)
    assert target.read_bytes() == whole


def test_what_was_begun_of_another_file_is_not_kept(ran: gridfall.Result, url: str, tmp_path: Path) -> None:
    (tmp_path / "a.mcap.part").write_bytes(b"of another job")
    (tmp_path / "a.mcap.part.etag").write_text('"another"')
    with gridfall.Client(url) as client:
        client.recording(ran.job, to=tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == ran.recording.path.read_bytes()


def test_frames_are_followed_over_a_lost_connection(ran: gridfall.Result, url: str) -> None:
    size = ran.recording.path.stat().st_size
    with flaky(url, [size // 2]) as way, gridfall.Client(way.url) as lost:
        followed = list(lost.follow(ran.job))
    assert [frame.index for frame in followed] == list(range(6)) and len(way.requests) == 2
    for one, other in zip(followed, ran.frames, strict=True):
        assert one.time == other.time and (one.positions == other.positions).all()


def test_a_busy_server_is_asked_again_when_it_says() -> None:
    answers = [(429, {"retry-after": "1"}), (503, {}), (200, {})]
    seen: list[float] = []

    def answer(request: httpx.Request) -> httpx.Response:
        seen.append(time.monotonic())
        status, headers = answers[len(seen) - 1]
        return httpx.Response(status, headers=headers, json={"devices": [], "reason": "", "state": "ready"})

    with gridfall.Client("http://test", transport=httpx.MockTransport(answer)) as client:
        assert client.devices().state == "ready"
    assert 1.0 <= seen[1] - seen[0] and seen[2] - seen[1] < 0.5


def test_a_full_queue_is_said(endless: dict[str, object]) -> None:
    with gridfall.serve(arguments=["--backend", "cpu", "--max-queued", "1"]) as url:
        with gridfall.Client(url, retries=0) as client:
            running = client.submit(endless)
            while client.job(running).status == "queued":
                time.sleep(0.02)
            client.submit(endless)
            with pytest.raises(gridfall.NotReady) as refused:
                client.submit(endless)
    assert (refused.value.status, refused.value.code) == (429, "queue_full")


def test_no_server() -> None:
    with gridfall.Client("http://127.0.0.1:9", retries=1) as client:
        with pytest.raises(gridfall.ServerUnreachable, match="GET /v1/devices"):
            client.devices()


def test_a_server_that_asks_for_a_key_gets_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def keys(*arguments: str) -> str:
        command = [str(gridfall.program()), "keys", *arguments, "--data-dir", str(tmp_path)]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    good, reader = keys("create", "good"), keys("create", "reader", "--scope", "read")
    monkeypatch.delenv("GRIDFALL_API_KEY", raising=False)
    with gridfall.serve(data_dir=tmp_path, arguments=["--backend", "cpu"]) as url:
        with gridfall.Client(url) as none, pytest.raises(gridfall.NotAllowed) as refused:
            list(none.jobs())
        assert (refused.value.status, refused.value.code) == (401, "key_required")
        with gridfall.Client(url, api_key=reader) as client:
            assert list(client.jobs()) == []
            with pytest.raises(gridfall.NotAllowed) as refused:
                client.submit(client.library_scene("quickstart"))
            assert refused.value.code == "insufficient_scope"
        monkeypatch.setenv("GRIDFALL_API_KEY", good)
        with gridfall.Client(url) as client:
            job = client.submit(client.library_scene("quickstart"))
            assert client.cancel(job).status in ("queued", "running", "canceled")
