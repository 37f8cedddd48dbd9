// A user's script on the client that openapi-generator makes for TypeScript with fetch.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { setTimeout } from 'node:timers/promises';
import * as gridfall from './client/index.js';

const [basePath = '', folder = ''] = process.argv.slice(2);
const read = (name: string) => readFileSync(`${folder}/${name}`);
const scene = gridfall.SceneFromJSON(JSON.parse(read('scene.json').toString()));
const endless = gridfall.SceneFromJSON(JSON.parse(read('endless.json').toString()));
const configuration = new gridfall.Configuration({ basePath });
const jobs = new gridfall.JobsApi(configuration);
const outputs = new gridfall.OutputsApi(configuration);

const judged = await new gridfall.ScenesApi(configuration).validateScene({ submitJob: { scene } });
assert(judged.valid && judged.estimate.particles === 64);
let job = await jobs.submitJob({ submitJob: { scene, name: 'typescript', overrides: { seed: 7 } } });
const { id } = job;
while (job.status === 'queued' || job.status === 'running') {
  await setTimeout(20);
  job = await jobs.getJob({ id });
}
assert.equal(job.status, 'succeeded');
const list = await jobs.listJobs({ status: ['succeeded'], limit: 200 });
assert(list.jobs.some((each) => each.id === id));
const recording: Blob = await outputs.getRecording({ id });
assert.equal(await recording.slice(1, 5).text(), 'MCAP');
const { rows } = await outputs.getDiagnostics({ id });
assert(rows.length === 6 && rows[0]?.massKg && rows[0].massKg === rows[5]?.massKg);
const csv = await outputs.getDiagnosticsCsv({ id });
assert(csv.startsWith('frame,time_s,') && csv.trim().split('\n').length === 7);
const body = new Blob([new Uint8Array(read('mesh.obj'))]);
const asset = await new gridfall.AssetsApi(configuration).uploadAsset({ body });
assert.equal(asset.kind, 'obj');
const doomed = await jobs.submitJob({ submitJob: { scene: endless } });
await jobs.cancelJob({ id: doomed.id });
while ((await jobs.getJob({ id: doomed.id })).status !== 'canceled') await setTimeout(20);
scene.domain.dx = -1;
const refused = await jobs.submitJob({ submitJob: { scene } }).catch((error: unknown) => error);
assert(refused instanceof gridfall.ResponseError);
const problem = gridfall.ProblemFromJSON(await refused.response.json());
assert.equal(problem.faults?.[0]?.pointer, '/scene/domain/dx');
