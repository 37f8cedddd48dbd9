-- Times are microseconds since the Unix epoch. Truth is 0 or 1.
CREATE TABLE jobs (
    seq               BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY, -- order of acceptance, and of service
    id                TEXT   NOT NULL UNIQUE,
    name              TEXT   NOT NULL,
    scene             TEXT   NOT NULL,
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
