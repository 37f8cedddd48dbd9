-- Times are microseconds since the Unix epoch. Truth is 0 or 1.
CREATE TABLE jobs (
    seq               BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY, -- order of acceptance
    id                TEXT   NOT NULL UNIQUE,
    name              TEXT   NOT NULL COLLATE "C", -- prefixes are searched by the index
    scene_sha256      TEXT   NOT NULL,
    build             TEXT,                      -- of the server that ran the last attempt
    priority          BIGINT NOT NULL DEFAULT 0, -- higher ones first
    tags              TEXT   NOT NULL DEFAULT '[]', -- JSON; job_tags is for searching
    deadline          BIGINT,                    -- not started by then: failed
    estimate_s        DOUBLE PRECISION,          -- wall time foretold
    sweep             TEXT,
    idempotency_key   TEXT   UNIQUE,
    request_sha256    TEXT   NOT NULL,
    status            TEXT   NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
    created_at        BIGINT NOT NULL,
    started_at        BIGINT,
    finished_at       BIGINT,
    attempt           BIGINT NOT NULL DEFAULT 0, -- counts claims; the fencing token of every write of an attempt
    owner             TEXT,                      -- the server that claimed it last
    lease_until       BIGINT NOT NULL DEFAULT 0,
    deaths            BIGINT NOT NULL DEFAULT 0, -- in a row, without a newer checkpoint between them
    checkpoint_frame  BIGINT,                    -- the newest frame that an attempt can go on from
    cancel_requested  BIGINT NOT NULL DEFAULT 0,
    particles         BIGINT NOT NULL,
    frames            BIGINT NOT NULL, -- to be written, frame 0 included
    end_time_s        DOUBLE PRECISION NOT NULL,
    sim_time_s        DOUBLE PRECISION NOT NULL DEFAULT 0,
    step              BIGINT NOT NULL DEFAULT 0,
    frames_written    BIGINT NOT NULL DEFAULT 0,
    run_s             DOUBLE PRECISION NOT NULL DEFAULT 0, -- wall time since the engine was loaded
    integrator        TEXT   NOT NULL,
    integrator_reason TEXT   NOT NULL,
    notices           TEXT   NOT NULL, -- JSON
    backend           TEXT,            -- JSON
    failure_code      TEXT,
    failure_message   TEXT
);

CREATE INDEX jobs_by_status ON jobs (status, seq);
CREATE INDEX jobs_in_queue ON jobs (priority DESC, seq) WHERE status = 'queued';
CREATE INDEX jobs_by_deadline ON jobs (deadline) WHERE status = 'queued';
CREATE INDEX jobs_by_name ON jobs (name, seq);
CREATE INDEX jobs_by_creation ON jobs (created_at, seq);
CREATE INDEX jobs_by_end ON jobs (finished_at, seq);
CREATE INDEX jobs_by_sweep ON jobs (sweep, seq) WHERE sweep IS NOT NULL;
CREATE INDEX jobs_by_scene ON jobs (scene_sha256, seq) WHERE status = 'succeeded';

-- A heartbeat writes a short row.
CREATE TABLE job_scenes (
    seq   BIGINT PRIMARY KEY REFERENCES jobs (seq) ON DELETE CASCADE,
    scene TEXT   NOT NULL
);

CREATE TABLE job_tags (
    tag TEXT   NOT NULL,
    seq BIGINT NOT NULL REFERENCES jobs (seq) ON DELETE CASCADE,
    PRIMARY KEY (tag, seq)
);
CREATE INDEX job_tags_by_job ON job_tags (seq);

CREATE TABLE sweeps (
    id         TEXT   PRIMARY KEY,
    name       TEXT   NOT NULL,
    created_at BIGINT NOT NULL
);
