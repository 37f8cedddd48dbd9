// A user's script on the types that openapi-typescript makes, with openapi-fetch.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { setTimeout } from 'node:timers/promises';
import createClient from 'openapi-fetch';
import type { components, paths } from './schema.js';

const [url = '', folder = ''] = process.argv.slice(2);
const read = (name: string) => readFileSync(`${folder}/${name}`);
const scene: components['schemas']['Scene'] = JSON.parse(read('scene.json').toString());
const endless: components['schemas']['Scene'] = JSON.parse(read('endless.json').toString());
const api = createClient<paths>({ baseUrl: url });
const got = <T>({ data, error }: { data?: T; error?: unknown }): T => {
  assert(data !== undefined, JSON.stringify(error));
  return data;
};

const judged = got(await api.POST('/v1/scenes:validate', { body: { scene, overrides: {} } }));
assert(judged.valid && judged.estimate.particles === 64);
let job = got(await api.POST('/v1/jobs', { body: { scene, name: 'typescript', overrides: { seed: 7 } } }));
const params = { path: { id: job.id } };
while (job.status === 'queued' || job.status === 'running') {
  await setTimeout(20);
  job = got(await api.GET('/v1/jobs/{id}', { params }));
}
assert.equal(job.status, 'succeeded');
const { jobs } = got(await api.GET('/v1/jobs', { params: { query: { status: ['succeeded'], limit: 200 } } }));
assert(jobs.some(({ id }) => id === job.id));
const blob = got(await api.GET('/v1/jobs/{id}/recording.mcap', { params, parseAs: 'arrayBuffer' }));
assert.equal(Buffer.from(blob).toString('latin1', 1, 5), 'MCAP');
const { rows } = got(await api.GET('/v1/jobs/{id}/diagnostics', { params }));
const mass: number | null | undefined = rows[0]?.mass_kg;
assert(rows.length === 6 && mass && mass === rows[5]?.mass_kg);
const csv: string = got(await api.GET('/v1/jobs/{id}/diagnostics.csv', { params, parseAs: 'text' }));
assert(csv.startsWith('frame,time_s,') && csv.trim().split('\n').length === 7);
const asset = got(
  await api.PUT('/v1/assets', {
    // Types have no bytes: what is `format: binary` is a string to them.
    body: new Blob([new Uint8Array(read('mesh.obj'))]) as unknown as string,
    bodySerializer: (body) => body,
    headers: { 'Content-Type': 'application/octet-stream' },
  }),
);
assert.equal(asset.kind, 'obj');
const doomed = got(await api.POST('/v1/jobs', { body: { scene: endless, overrides: {} } }));
let end = got(await api.POST('/v1/jobs/{id}/cancel', { params: { path: { id: doomed.id } } }));
while (end.status !== 'canceled') {
  await setTimeout(20);
  end = got(await api.GET('/v1/jobs/{id}', { params: { path: { id: doomed.id } } }));
}
const bad = { ...scene, domain: { ...scene.domain, dx: -1 } };
const { error } = await api.POST('/v1/jobs', { body: { scene: bad, overrides: {} } });
assert.equal(error?.faults?.[0]?.pointer, '/scene/domain/dx');
