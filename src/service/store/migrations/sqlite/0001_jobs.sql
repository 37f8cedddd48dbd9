-- Times are microseconds since the Unix epoch.
CREATE TABLE jobs (
    seq              INTEGER PRIMARY KEY AUTOINCREMENT, -- order of acceptance, and of service
    id               TEXT    NOT NULL UNIQUE,
    name             TEXT    NOT NULL,
    scene            TEXT    NOT NULL,
    idempotency_key  TEXT    UNIQUE,
    request_sha256   TEXT    NOT NULL,
    status           TEXT    NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
    created_at       INTEGER NOT NULL,
    started_at       INTEGER,
    finished_at      INTEGER,
    attempt          INTEGER NOT NULL DEFAULT 0, -- counts claims; the fencing token of every write of an attempt
    lost_attempts    INTEGER NOT NULL DEFAULT 0, -- attempts that took their process or device with them
    cancel_requested INTEGER NOT NULL DEFAULT 0,
    particles        INTEGER NOT NULL,
    frames           INTEGER NOT NULL, -- to be written, frame 0 included
    end_time_s       REAL    NOT NULL,
    sim_time_s       REAL    NOT NULL DEFAULT 0,
    step             INTEGER NOT NULL DEFAULT 0,
    frames_written   INTEGER NOT NULL DEFAULT 0,
    run_s            REAL    NOT NULL DEFAULT 0, -- wall time since the engine was loaded
    backend          TEXT,                       -- JSON
    failure_code     TEXT,
    failure_message  TEXT
) STRICT;

CREATE INDEX jobs_by_status ON jobs (status, seq);
