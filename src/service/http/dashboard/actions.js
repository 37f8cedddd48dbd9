// What can be done with jobs, one or many.

import { ApiError, get, json, request } from "./api.js";
import { confirm, toast } from "./dom.js";

export const ENDED = ["succeeded", "failed", "canceled"];
export const hasEnded = (job) => ENDED.includes(job.status);

const path = (job, rest = "") => `/v1/jobs/${job.id}${rest}`;

const one = {
  cancel: (job) => json("POST", path(job, "/cancel")),
  rerun: (job) => json("POST", path(job, "/rerun"), { body: {} }),
  remove: (job) => request("DELETE", path(job)),
};

const SAID = { cancel: "canceled", rerun: "submitted again", remove: "deleted" };

/** Does something with jobs, a few at a time, and says how it went. Returns the answers. */
async function each(what, jobs) {
  const [answers, problems, waiting] = [[], [], [...jobs]];
  const worker = async () => {
    for (let job = waiting.shift(); job; job = waiting.shift()) {
      try {
        answers.push(await one[what](job));
      } catch (error) {
        problems.push(`${job.name}: ${error instanceof ApiError ? error.problem.detail : error.message}`);
      }
    }
  };
  await Promise.all(Array.from({ length: 4 }, worker));
  if (answers.length) toast(`${answers.length} ${answers.length === 1 ? "job" : "jobs"} ${SAID[what]}.`);
  problems.slice(0, 3).forEach((text) => toast(text, "bad"));
  return answers;
}

const named = (jobs) => (jobs.length === 1 ? `“${jobs[0].name}”` : `${jobs.length} jobs`);

export async function cancel(jobs) {
  const open = jobs.filter((job) => !hasEnded(job));
  if (!open.length) return toast("All of them have ended already.");
  const detail = "What was recorded so far is kept. A job that was canceled cannot go on, but it can be run again.";
  if (await confirm({ title: `Cancel ${named(open)}?`, detail, action: "Cancel now", danger: true })) {
    return each("cancel", open);
  }
}

export const rerun = (jobs) => each("rerun", jobs);

export async function remove(jobs) {
  const ended = jobs.filter(hasEnded);
  if (!ended.length) return toast("Only jobs that have ended can be deleted; cancel them first.", "bad");
  const detail = "The jobs and all their files are gone then.";
  if (await confirm({ title: `Delete ${named(ended)}?`, detail, action: "Delete", danger: true })) {
    return each("remove", ended);
  }
}

/** Cancels or deletes all jobs of a filter, as `/v1/jobs:cancel` and `/v1/jobs:delete` take it. */
export async function all(what, filter, described) {
  const open = what === "cancel";
  const of = open ? ["queued", "running"] : ENDED;
  const status = (filter.status.length ? filter.status : of).filter((status) => of.includes(status));
  if (!status.length) return toast(open ? "None of these can be canceled." : "None of these has ended.", "bad");
  const title = `${open ? "Cancel" : "Delete"} all ${status.join(" and ")} jobs${described}?`;
  const detail = open ? "Also those on other pages of the list." : "Also those on other pages, and all their files.";
  if (!(await confirm({ title, detail, action: open ? "Cancel all" : "Delete all", danger: true }))) return;
  try {
    const { jobs } = await json("POST", `/v1/jobs:${what}`, { body: { ...filter, status } });
    toast(`${jobs} ${jobs === 1 ? "job" : "jobs"} ${open ? "canceled" : "deleted"}.`);
  } catch (error) {
    toast(error.message, "bad");
  }
}

/** The scene of a job, as text to edit: lists without objects are in one line. */
export async function sceneOf(id, signal) {
  const text = JSON.stringify(await get(`/v1/jobs/${id}/scene`, signal), null, 2);
  return text.replace(/\[\n\s+([^[\]{}]*?)\n\s+\]/g, (_, inner) => `[${inner.replace(/\n\s+/g, " ")}]`);
}
