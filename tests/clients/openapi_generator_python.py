"""A user's script on the client that openapi-generator makes for Python."""

import json
import sys
import time
from pathlib import Path

import gridfall_client as gridfall

url, folder = sys.argv[1], Path(sys.argv[2])
scene = gridfall.Scene.from_dict(json.loads((folder / "scene.json").read_text()))
endless = gridfall.Scene.from_dict(json.loads((folder / "endless.json").read_text()))

with gridfall.ApiClient(gridfall.Configuration(host=url)) as client:
    jobs, outputs = gridfall.JobsApi(client), gridfall.OutputsApi(client)
    judged = gridfall.ScenesApi(client).validate_scene(gridfall.SubmitJob(scene=scene))
    assert judged.valid and judged.estimate.particles == 64, judged
    job = jobs.submit_job(gridfall.SubmitJob(scene=scene, name="python", overrides={"seed": 7}))
    while (job := jobs.get_job(job.id)).status not in ("succeeded", "failed", "canceled"):
        time.sleep(0.02)
    assert job.status == "succeeded" and job.name == "python", job
    assert job.id in [each.id for each in jobs.list_jobs(status=["succeeded"], limit=200).jobs]
    recording = outputs.get_recording(job.id)
    assert bytes(recording[:5]) == b"\x89MCAP", recording[:5]
    assert bytes(outputs.get_recording(job.id, range="bytes=0-4")) == bytes(recording[:5])
    rows = outputs.get_diagnostics(job.id).rows
    assert len(rows) == 6 and rows[0].mass_kg == rows[5].mass_kg > 0, rows
    csv = outputs.get_diagnostics_csv(job.id).splitlines()
    assert len(csv) == 7 and csv[0].startswith("frame,time_s,"), csv
    asset = gridfall.AssetsApi(client).upload_asset((folder / "mesh.obj").read_bytes())
    assert asset.kind == "obj" and asset.id.startswith("sha256:"), asset
    doomed = jobs.submit_job(gridfall.SubmitJob(scene=endless))
    jobs.cancel_job(doomed.id)
    while jobs.get_job(doomed.id).status != "canceled":
        time.sleep(0.02)
    try:
        scene.domain.dx = -1.0
        jobs.submit_job(gridfall.SubmitJob(scene=scene))
        raise AssertionError("a negative spacing was accepted")
    except gridfall.ApiException as error:
        assert error.status == 422 and error.data.faults[0].pointer == "/scene/domain/dx", error
