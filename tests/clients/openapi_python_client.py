"""A user's script on the client that openapi-python-client makes."""

import io
import json
import sys
import time
from pathlib import Path

from openapi_client import Client
from openapi_client.api.assets import upload_asset
from openapi_client.api.jobs import cancel_job, get_job, list_jobs, submit_job
from openapi_client.api.outputs import get_diagnostics, get_diagnostics_csv, get_recording
from openapi_client.api.scenes import validate_scene
from openapi_client.models import Problem, Scene, Status, SubmitJob
from openapi_client.types import File

url, folder = sys.argv[1], Path(sys.argv[2])
client = Client(base_url=url)
scene = json.loads((folder / "scene.json").read_text())
endless = json.loads((folder / "endless.json").read_text())


def request(scene, **more):
    return SubmitJob(scene=Scene.from_dict(scene), **more)


judged = validate_scene.sync(client=client, body=request(scene))
assert judged.valid and judged.estimate.particles == 64, judged
job = submit_job.sync(client=client, body=request(scene, name="openapi-python-client"))
while (job := get_job.sync(job.id, client=client)).status in (Status.QUEUED, Status.RUNNING):
    time.sleep(0.02)
assert job.status == Status.SUCCEEDED and job.name == "openapi-python-client", job
assert job.id in [each.id for each in list_jobs.sync(client=client, limit=200).jobs]
recording = get_recording.sync(job.id, client=client)
assert recording.payload.read(5) == b"\x89MCAP"
rows = get_diagnostics.sync(job.id, client=client).rows
assert len(rows) == 6 and rows[0].mass_kg == rows[5].mass_kg > 0, rows
csv = get_diagnostics_csv.sync(job.id, client=client).splitlines()
assert len(csv) == 7 and csv[0].startswith("frame,time_s,"), csv
asset = upload_asset.sync(client=client, body=File(payload=io.BytesIO((folder / "mesh.obj").read_bytes())))
assert asset.kind == "obj" and asset.id.startswith("sha256:"), asset
doomed = submit_job.sync(client=client, body=request(endless))
cancel_job.sync(doomed.id, client=client)
while get_job.sync(doomed.id, client=client).status != Status.CANCELED:
    time.sleep(0.02)
scene["domain"]["dx"] = -1
refused = submit_job.sync(client=client, body=request(scene))
assert isinstance(refused, Problem) and refused.faults[0].pointer == "/scene/domain/dx", refused
