-- Who may ask for what, and how much of it. A key is kept after its end: its jobs still belong to it.
CREATE TABLE keys (
    id            TEXT    PRIMARY KEY,
    name          TEXT    NOT NULL UNIQUE,
    secret_sha256 TEXT    NOT NULL UNIQUE,
    scope         TEXT    NOT NULL CHECK (scope IN ('read', 'submit', 'admin')),
    created_at    INTEGER NOT NULL,
    expires_at    INTEGER,
    revoked_at    INTEGER,
    last_used_at  INTEGER,
    max_queued    INTEGER,
    max_running   INTEGER,
    max_particles INTEGER, -- of a scene
    max_bytes     INTEGER, -- kept
    max_device_s  INTEGER, -- in 30 days
    bytes         INTEGER NOT NULL DEFAULT 0, -- kept: outputs of ended jobs, and uploads
    device_us     INTEGER NOT NULL DEFAULT 0, -- ever
    turn_us       INTEGER NOT NULL DEFAULT 0  -- the same but for what it let pass: the least is next
) STRICT, WITHOUT ROWID;

CREATE TABLE key_usage (
    key_id    TEXT    NOT NULL REFERENCES keys (id),
    day       INTEGER NOT NULL,           -- since the Unix epoch
    jobs      INTEGER NOT NULL DEFAULT 0, -- accepted
    device_us INTEGER NOT NULL DEFAULT 0,
    PRIMARY KEY (key_id, day)
) STRICT, WITHOUT ROWID;

-- The uploads and scenes that a key has sent. The files are by their content, and may be several keys'.
CREATE TABLE key_files (
    key_id TEXT    NOT NULL REFERENCES keys (id),
    kind   TEXT    NOT NULL CHECK (kind IN ('asset', 'scene')),
    id     TEXT    NOT NULL,
    bytes  INTEGER NOT NULL,
    PRIMARY KEY (key_id, kind, id)
) STRICT, WITHOUT ROWID;

-- Whose a job is. Empty where nobody was asked for a key.
ALTER TABLE jobs ADD COLUMN key_id TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN device_us INTEGER NOT NULL DEFAULT 0; -- of all attempts, up to the last heartbeat
ALTER TABLE jobs ADD COLUMN beat_at INTEGER NOT NULL DEFAULT 0;   -- the last heartbeat
ALTER TABLE jobs ADD COLUMN bytes INTEGER;                        -- of the outputs, once they have been measured
ALTER TABLE sweeps ADD COLUMN key_id TEXT NOT NULL DEFAULT '';

DROP INDEX jobs_in_queue;
CREATE INDEX jobs_in_queue ON jobs (key_id, priority DESC, seq) WHERE status = 'queued';
CREATE INDEX jobs_by_key ON jobs (key_id, status, seq);
CREATE INDEX jobs_to_measure ON jobs (seq) WHERE bytes IS NULL AND finished_at IS NOT NULL AND key_id <> '';
CREATE INDEX sweeps_of_key ON sweeps (key_id, id);

CREATE TRIGGER job_accepted AFTER INSERT ON jobs WHEN NEW.key_id <> '' BEGIN
    INSERT INTO key_usage (key_id, day, jobs) VALUES (NEW.key_id, NEW.created_at / 86400000000, 1)
        ON CONFLICT (key_id, day) DO UPDATE SET jobs = key_usage.jobs + 1;
END;

CREATE TRIGGER job_ran AFTER UPDATE OF device_us ON jobs WHEN NEW.key_id <> '' AND NEW.device_us > OLD.device_us BEGIN
    INSERT INTO key_usage (key_id, day, device_us)
        VALUES (NEW.key_id, NEW.beat_at / 86400000000, NEW.device_us - OLD.device_us)
        ON CONFLICT (key_id, day) DO UPDATE SET device_us = key_usage.device_us + excluded.device_us;
    UPDATE keys SET device_us = device_us + NEW.device_us - OLD.device_us,
        turn_us = turn_us + NEW.device_us - OLD.device_us WHERE id = NEW.key_id;
END;

CREATE TRIGGER job_measured AFTER UPDATE OF bytes ON jobs WHEN NEW.key_id <> '' BEGIN
    UPDATE keys SET bytes = bytes + coalesce(NEW.bytes, 0) - coalesce(OLD.bytes, 0) WHERE id = NEW.key_id;
END;

CREATE TRIGGER job_deleted AFTER DELETE ON jobs WHEN OLD.key_id <> '' AND OLD.bytes > 0 BEGIN
    UPDATE keys SET bytes = bytes - OLD.bytes WHERE id = OLD.key_id;
END;

CREATE TRIGGER file_kept AFTER INSERT ON key_files BEGIN
    UPDATE keys SET bytes = bytes + NEW.bytes WHERE id = NEW.key_id;
END;
