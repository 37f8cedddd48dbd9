-- Who is told of what happens to jobs.
CREATE TABLE webhooks (
    id         TEXT    PRIMARY KEY,
    url        TEXT    NOT NULL,
    secret     TEXT    NOT NULL,
    events     TEXT    NOT NULL, -- types, as JSON; empty for all
    created_at BIGINT  NOT NULL,
    enabled    BIGINT  NOT NULL DEFAULT 1
);

-- What happened, and the job as it was then, until a server has made deliveries of it.
CREATE TABLE webhook_events (
    event             BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    at                BIGINT  NOT NULL,
    seq               BIGINT  NOT NULL,
    id                TEXT    NOT NULL,
    name              TEXT    NOT NULL,
    status            TEXT    NOT NULL,
    created_at        BIGINT  NOT NULL,
    started_at        BIGINT,
    finished_at       BIGINT,
    attempt           BIGINT  NOT NULL,
    deaths            BIGINT  NOT NULL,
    checkpoint_frame  BIGINT,
    cancel_requested  BIGINT  NOT NULL,
    particles         BIGINT  NOT NULL,
    frames            BIGINT  NOT NULL,
    end_time_s        DOUBLE PRECISION NOT NULL,
    sim_time_s        DOUBLE PRECISION NOT NULL,
    step              BIGINT  NOT NULL,
    frames_written    BIGINT  NOT NULL,
    run_s             DOUBLE PRECISION NOT NULL,
    integrator        TEXT    NOT NULL,
    integrator_reason TEXT    NOT NULL,
    notices           TEXT    NOT NULL,
    backend           TEXT,
    failure_code      TEXT,
    failure_message   TEXT,
    priority          BIGINT  NOT NULL,
    tags              TEXT    NOT NULL,
    deadline          BIGINT,
    estimate_s        DOUBLE PRECISION,
    sweep             TEXT,
    sweep_values      TEXT    NOT NULL,
    cluster_job       TEXT,
    key_id            TEXT NOT NULL
);

-- Triggers write in the transaction of the change, whoever makes it: neither is there without the other.
CREATE FUNCTION webhook_event() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO webhook_events (
        at, seq, id, name, status, created_at, started_at, finished_at, attempt, deaths, checkpoint_frame,
        cancel_requested, particles, frames, end_time_s, sim_time_s, step, frames_written, run_s, integrator,
        integrator_reason, notices, backend, failure_code, failure_message, priority, tags, deadline, estimate_s,
        sweep, sweep_values, cluster_job, key_id
    ) SELECT
        CASE WHEN TG_OP = 'INSERT' THEN NEW.created_at
             ELSE coalesce(NEW.finished_at, NEW.started_at, (extract(epoch FROM clock_timestamp()) * 1000000)::bigint)
        END,
        NEW.seq, NEW.id, NEW.name, NEW.status, NEW.created_at, NEW.started_at, NEW.finished_at,
        NEW.attempt, NEW.deaths, NEW.checkpoint_frame, NEW.cancel_requested, NEW.particles, NEW.frames,
        NEW.end_time_s, NEW.sim_time_s, NEW.step, NEW.frames_written, NEW.run_s, NEW.integrator,
        NEW.integrator_reason, NEW.notices, NEW.backend, NEW.failure_code, NEW.failure_message, NEW.priority,
        NEW.tags, NEW.deadline, NEW.estimate_s, NEW.sweep, NEW.sweep_values, NEW.cluster_job, NEW.key_id
    WHERE EXISTS (SELECT 1 FROM webhooks WHERE enabled = 1);
    RETURN NULL;
END
$$;
CREATE TRIGGER webhook_events_of_new_jobs AFTER INSERT ON jobs FOR EACH ROW EXECUTE FUNCTION webhook_event();
CREATE TRIGGER webhook_events_of_jobs AFTER UPDATE OF status ON jobs FOR EACH ROW
WHEN (OLD.status <> NEW.status) EXECUTE FUNCTION webhook_event();

-- What is sent, to whom, and how that went.
CREATE TABLE webhook_deliveries (
    seq         BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    id          TEXT    NOT NULL UNIQUE, -- the header webhook-id, the same in all attempts
    webhook     TEXT    NOT NULL REFERENCES webhooks (id) ON DELETE CASCADE,
    event       TEXT    NOT NULL,
    subject     TEXT    NOT NULL, -- the job or the sweep
    payload     TEXT    NOT NULL,
    created_at  BIGINT  NOT NULL,
    status      TEXT    NOT NULL CHECK (status IN ('pending', 'delivered', 'dead')),
    attempt     BIGINT  NOT NULL DEFAULT 0, -- counts claims; the fencing token of what an attempt writes
    spent       BIGINT  NOT NULL DEFAULT 0, -- claims before the last retry by hand
    claimed     BIGINT  NOT NULL DEFAULT 0, -- being sent now
    next_at     BIGINT  NOT NULL, -- when it may be claimed; while it is being sent, the end of the lease
    answered_at BIGINT,
    answer_code BIGINT, -- status of the last answer; none where none came
    answer      TEXT
);

CREATE INDEX webhook_deliveries_due ON webhook_deliveries (next_at) WHERE status = 'pending';
CREATE INDEX webhook_deliveries_by_status ON webhook_deliveries (status, created_at);
CREATE INDEX webhook_deliveries_by_webhook ON webhook_deliveries (webhook, seq);
-- A sweep ends once, though several of its jobs may be seen as the last.
CREATE UNIQUE INDEX webhook_deliveries_of_sweeps ON webhook_deliveries (webhook, subject)
WHERE event = 'sweep.finished';
