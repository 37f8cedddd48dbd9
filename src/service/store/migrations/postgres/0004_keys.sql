-- Who may ask for what, and how much of it. A key is kept after its end: its jobs still belong to it.
CREATE TABLE keys (
    id            TEXT   PRIMARY KEY,
    name          TEXT   NOT NULL UNIQUE,
    secret_sha256 TEXT   NOT NULL UNIQUE,
    scope         TEXT   NOT NULL CHECK (scope IN ('read', 'submit', 'admin')),
    created_at    BIGINT NOT NULL,
    expires_at    BIGINT,
    revoked_at    BIGINT,
    last_used_at  BIGINT,
    max_queued    BIGINT,
    max_running   BIGINT,
    max_particles BIGINT, -- of a scene
    max_bytes     BIGINT, -- kept
    max_device_s  BIGINT, -- in 30 days
    bytes         BIGINT NOT NULL DEFAULT 0, -- kept: outputs of ended jobs, and uploads
    device_us     BIGINT NOT NULL DEFAULT 0, -- ever
    turn_us       BIGINT NOT NULL DEFAULT 0  -- the same but for what it let pass: the least is next
);

CREATE TABLE key_usage (
    key_id    TEXT   NOT NULL REFERENCES keys (id),
    day       BIGINT NOT NULL,           -- since the Unix epoch
    jobs      BIGINT NOT NULL DEFAULT 0, -- accepted
    device_us BIGINT NOT NULL DEFAULT 0,
    PRIMARY KEY (key_id, day)
);

-- The uploads and scenes that a key has sent. The files are by their content, and may be several keys'.
CREATE TABLE key_files (
    key_id TEXT   NOT NULL REFERENCES keys (id),
    kind   TEXT   NOT NULL CHECK (kind IN ('asset', 'scene')),
    id     TEXT   NOT NULL,
    bytes  BIGINT NOT NULL,
    PRIMARY KEY (key_id, kind, id)
);

-- Whose a job is. Empty where nobody was asked for a key.
ALTER TABLE jobs ADD COLUMN key_id TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN device_us BIGINT NOT NULL DEFAULT 0; -- of all attempts, up to the last heartbeat
ALTER TABLE jobs ADD COLUMN beat_at BIGINT NOT NULL DEFAULT 0;   -- the last heartbeat
ALTER TABLE jobs ADD COLUMN bytes BIGINT;                        -- of the outputs, once they have been measured
ALTER TABLE sweeps ADD COLUMN key_id TEXT NOT NULL DEFAULT '';

DROP INDEX jobs_in_queue;
CREATE INDEX jobs_in_queue ON jobs (key_id, priority DESC, seq) WHERE status = 'queued';
CREATE INDEX jobs_by_key ON jobs (key_id, status, seq);
CREATE INDEX jobs_to_measure ON jobs (seq) WHERE bytes IS NULL AND finished_at IS NOT NULL AND key_id <> '';
CREATE INDEX sweeps_of_key ON sweeps (key_id, id);

CREATE FUNCTION job_accepted() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO key_usage (key_id, day, jobs) VALUES (NEW.key_id, NEW.created_at / 86400000000, 1)
        ON CONFLICT (key_id, day) DO UPDATE SET jobs = key_usage.jobs + 1;
    RETURN NULL;
END $$;
CREATE TRIGGER job_accepted AFTER INSERT ON jobs FOR EACH ROW WHEN (NEW.key_id <> '')
    EXECUTE FUNCTION job_accepted();

CREATE FUNCTION job_ran() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO key_usage (key_id, day, device_us)
        VALUES (NEW.key_id, NEW.beat_at / 86400000000, NEW.device_us - OLD.device_us)
        ON CONFLICT (key_id, day) DO UPDATE SET device_us = key_usage.device_us + excluded.device_us;
    UPDATE keys SET device_us = device_us + NEW.device_us - OLD.device_us,
        turn_us = turn_us + NEW.device_us - OLD.device_us WHERE id = NEW.key_id;
    RETURN NULL;
END $$;
CREATE TRIGGER job_ran AFTER UPDATE OF device_us ON jobs FOR EACH ROW
    WHEN (NEW.key_id <> '' AND NEW.device_us > OLD.device_us) EXECUTE FUNCTION job_ran();

CREATE FUNCTION job_measured() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    UPDATE keys SET bytes = bytes + coalesce(NEW.bytes, 0) - coalesce(OLD.bytes, 0) WHERE id = NEW.key_id;
    RETURN NULL;
END $$;
CREATE TRIGGER job_measured AFTER UPDATE OF bytes ON jobs FOR EACH ROW WHEN (NEW.key_id <> '')
    EXECUTE FUNCTION job_measured();

CREATE FUNCTION job_deleted() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    UPDATE keys SET bytes = bytes - OLD.bytes WHERE id = OLD.key_id;
    RETURN NULL;
END $$;
CREATE TRIGGER job_deleted AFTER DELETE ON jobs FOR EACH ROW WHEN (OLD.key_id <> '' AND OLD.bytes > 0)
    EXECUTE FUNCTION job_deleted();

CREATE FUNCTION file_kept() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    UPDATE keys SET bytes = bytes + NEW.bytes WHERE id = NEW.key_id;
    RETURN NULL;
END $$;
CREATE TRIGGER file_kept AFTER INSERT ON key_files FOR EACH ROW EXECUTE FUNCTION file_kept();
