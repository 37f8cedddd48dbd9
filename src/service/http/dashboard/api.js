// The API, as any client uses it, and whether it can be reached.

/** An answer that is an error; `problem` is its body (RFC 9457), or made of what is known. */
export class ApiError extends Error {
  constructor(problem) {
    super(problem.detail ?? problem.title);
    this.problem = problem;
  }
}

/** The server did not answer. */
export class Unreachable extends Error {}

/** What happens when the server asks for a key. */
export const door = { closed: () => {} };

/** Sends a request and returns the answer. `body` is sent as JSON; a string is JSON already. */
export async function request(method, path, { body, headers = {}, signal } = {}) {
  const given = body === undefined ? {} : { "content-type": "application/json" };
  const content = body === undefined || typeof body === "string" ? body : JSON.stringify(body);
  let answer;
  try {
    answer = await fetch(path, { method, body: content, headers: { ...given, ...headers }, signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Unreachable("The server does not answer.");
  }
  connection.found();
  if (answer.ok) return answer;
  if (answer.status === 401 && path !== "/v1/session") door.closed();
  const problem = await answer.json().catch(() => null);
  throw new ApiError(problem ?? { title: `The server answered ${answer.status}`, status: answer.status, detail: "" });
}

export const json = async (method, path, options) => (await request(method, path, options)).json();
export const get = (path, signal) => json("GET", path, { signal });

/** A key that no other request has; `randomUUID` is for secure pages only. */
export const freshKey = () => Array.from(crypto.getRandomValues(new Uint32Array(4)), (n) => n.toString(16)).join("-");

/** Whether the server can be reached. `changed` is called with seconds until the next try, or with null. */
export const connection = {
  changed: () => {},
  retries: new Set(),
  lost(seconds) {
    this.changed(seconds);
  },
  found() {
    this.changed(null);
  },
  retry() {
    [...this.retries].forEach((now) => now());
  },
};

/** Resolves after a time, when the user wants to try now, or when the signal ends. */
function pause(milliseconds, signal) {
  return new Promise((resolve) => {
    const done = () => {
      clearTimeout(timer);
      connection.retries.delete(done);
      signal.removeEventListener("abort", done);
      resolve();
    };
    const timer = setTimeout(done, milliseconds);
    connection.retries.add(done);
    signal.addEventListener("abort", done);
  });
}

/** Seconds before the n-th try. */
const backOff = (failures) => Math.min(2 ** (failures - 1), 30);

/** Does a task again and again, while the page can be seen. Returns a function that does it now. */
export function repeat(task, interval, signal) {
  let wake = () => {};
  const run = async () => {
    let failures = 0;
    while (!signal.aborted) {
      try {
        if (!document.hidden) await task();
        failures = 0;
      } catch (error) {
        if (signal.aborted) return;
        if (!(error instanceof Unreachable)) {
          console.error(error);
        } else {
          failures += 1;
          connection.lost(backOff(failures));
        }
      }
      const wait = failures ? backOff(failures) * 1000 : interval;
      await Promise.race([pause(wait, signal), new Promise((resolve) => (wake = resolve))]);
    }
  };
  const seen = () => !document.hidden && wake();
  document.addEventListener("visibilitychange", seen);
  signal.addEventListener("abort", () => document.removeEventListener("visibilitychange", seen));
  run();
  return () => wake();
}

/** Server-sent events, to their end. Goes on after the last one when the connection was lost. */
export async function follow(path, handle, signal) {
  let [last, failures, over] = ["", 0, false];
  const ends = (event, data) => event === "deleted" || (data.status && !["queued", "running"].includes(data.status));
  while (!signal.aborted && !over) {
    try {
      const answer = await request("GET", path, { headers: last ? { "last-event-id": last } : {}, signal });
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        failures = 0;
        const parts = (rest + value).split("\n\n");
        rest = parts.pop();
        for (const part of parts) {
          const fields = { event: "message", data: "" };
          for (const line of part.split("\n")) {
            const at = line.indexOf(":");
            if (at > 0) fields[line.slice(0, at)] = line.slice(at + 1).replace(/^ /, "");
          }
          if (fields.id) last = fields.id;
          if (!fields.data) continue;
          const data = fields.event === "log" ? fields.data : JSON.parse(fields.data);
          over ||= ends(fields.event, data);
          handle(fields.event, data);
        }
      }
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof ApiError) throw error;
    }
    if (over) return;
    failures += 1;
    connection.lost(backOff(failures));
    await pause(backOff(failures) * 1000, signal);
  }
}
