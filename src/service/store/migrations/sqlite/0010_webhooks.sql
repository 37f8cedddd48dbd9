-- Who is told of what happens to jobs.
CREATE TABLE webhooks (
    id         TEXT    PRIMARY KEY,
    url        TEXT    NOT NULL,
    secret     TEXT    NOT NULL,
    events     TEXT    NOT NULL, -- types, as JSON; empty for all
    created_at INTEGER NOT NULL,
    enabled    INTEGER NOT NULL DEFAULT 1
) STRICT, WITHOUT ROWID;

-- What happened, and the job as it was then, until a server has made deliveries of it.
CREATE TABLE webhook_events (
    event             INTEGER PRIMARY KEY AUTOINCREMENT,
    at                INTEGER NOT NULL,
    seq               INTEGER NOT NULL,
    id                TEXT    NOT NULL,
    name              TEXT    NOT NULL,
    status            TEXT    NOT NULL,
    created_at        INTEGER NOT NULL,
    started_at        INTEGER,
    finished_at       INTEGER,
    attempt           INTEGER NOT NULL,
    deaths            INTEGER NOT NULL,
    checkpoint_frame  INTEGER,
    cancel_requested  INTEGER NOT NULL,
    particles         INTEGER NOT NULL,
    frames            INTEGER NOT NULL,
    end_time_s        REAL    NOT NULL,
    sim_time_s        REAL    NOT NULL,
    step              INTEGER NOT NULL,
    frames_written    INTEGER NOT NULL,
    run_s             REAL    NOT NULL,
    integrator        TEXT    NOT NULL,
    integrator_reason TEXT    NOT NULL,
    notices           TEXT    NOT NULL,
    backend           TEXT,
    failure_code      TEXT,
    failure_message   TEXT,
    priority          INTEGER NOT NULL,
    tags              TEXT    NOT NULL,
    deadline          INTEGER,
    estimate_s        REAL,
    sweep             TEXT,
    sweep_values      TEXT    NOT NULL,
    cluster_job       TEXT,
    key_id            TEXT NOT NULL
) STRICT;

-- Triggers write in the transaction of the change, whoever makes it: neither is there without the other.
CREATE TRIGGER webhook_events_of_new_jobs AFTER INSERT ON jobs
WHEN EXISTS (SELECT 1 FROM webhooks WHERE enabled = 1)
BEGIN
    INSERT INTO webhook_events (
        at, seq, id, name, status, created_at, started_at, finished_at, attempt, deaths, checkpoint_frame,
        cancel_requested, particles, frames, end_time_s, sim_time_s, step, frames_written, run_s, integrator,
        integrator_reason, notices, backend, failure_code, failure_message, priority, tags, deadline, estimate_s,
        sweep, sweep_values, cluster_job, key_id
    ) VALUES (
        new.created_at, new.seq, new.id, new.name, new.status, new.created_at, new.started_at, new.finished_at,
        new.attempt, new.deaths, new.checkpoint_frame, new.cancel_requested, new.particles, new.frames,
        new.end_time_s, new.sim_time_s, new.step, new.frames_written, new.run_s, new.integrator,
        new.integrator_reason, new.notices, new.backend, new.failure_code, new.failure_message, new.priority,
        new.tags, new.deadline, new.estimate_s, new.sweep, new.sweep_values, new.cluster_job, new.key_id
    );
END;

CREATE TRIGGER webhook_events_of_jobs AFTER UPDATE OF status ON jobs
WHEN old.status <> new.status AND EXISTS (SELECT 1 FROM webhooks WHERE enabled = 1)
BEGIN
    INSERT INTO webhook_events (
        at, seq, id, name, status, created_at, started_at, finished_at, attempt, deaths, checkpoint_frame,
        cancel_requested, particles, frames, end_time_s, sim_time_s, step, frames_written, run_s, integrator,
        integrator_reason, notices, backend, failure_code, failure_message, priority, tags, deadline, estimate_s,
        sweep, sweep_values, cluster_job, key_id
    ) VALUES (
        coalesce(new.finished_at, new.started_at, CAST(unixepoch('subsec') * 1000000 AS INTEGER)),
        new.seq, new.id, new.name, new.status, new.created_at, new.started_at, new.finished_at,
        new.attempt, new.deaths, new.checkpoint_frame, new.cancel_requested, new.particles, new.frames,
        new.end_time_s, new.sim_time_s, new.step, new.frames_written, new.run_s, new.integrator,
        new.integrator_reason, new.notices, new.backend, new.failure_code, new.failure_message, new.priority,
        new.tags, new.deadline, new.estimate_s, new.sweep, new.sweep_values, new.cluster_job, new.key_id
    );
END;

-- What is sent, to whom, and how that went.
CREATE TABLE webhook_deliveries (
    seq         INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT    NOT NULL UNIQUE, -- the header webhook-id, the same in all attempts
    webhook     TEXT    NOT NULL REFERENCES webhooks (id) ON DELETE CASCADE,
    event       TEXT    NOT NULL,
    subject     TEXT    NOT NULL, -- the job or the sweep
    payload     TEXT    NOT NULL,
    created_at  INTEGER NOT NULL,
    status      TEXT    NOT NULL CHECK (status IN ('pending', 'delivered', 'dead')),
    attempt     INTEGER NOT NULL DEFAULT 0, -- counts claims; the fencing token of what an attempt writes
    spent       INTEGER NOT NULL DEFAULT 0, -- claims before the last retry by hand
    claimed     INTEGER NOT NULL DEFAULT 0, -- being sent now
    next_at     INTEGER NOT NULL, -- when it may be claimed; while it is being sent, the end of the lease
    answered_at INTEGER,
    answer_code INTEGER, -- status of the last answer; none where none came
    answer      TEXT
) STRICT;

CREATE INDEX webhook_deliveries_due ON webhook_deliveries (next_at) WHERE status = 'pending';
CREATE INDEX webhook_deliveries_by_status ON webhook_deliveries (status, created_at);
CREATE INDEX webhook_deliveries_by_webhook ON webhook_deliveries (webhook, seq);
-- A sweep ends once, though several of its jobs may be seen as the last.
CREATE UNIQUE INDEX webhook_deliveries_of_sweeps ON webhook_deliveries (webhook, subject)
WHERE event = 'sweep.finished';
