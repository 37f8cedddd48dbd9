-- Scenes in a table of their own: a heartbeat then writes a short row.
CREATE TABLE job_scenes (
    seq   INTEGER PRIMARY KEY REFERENCES jobs (seq) ON DELETE CASCADE,
    scene TEXT    NOT NULL
) STRICT;
INSERT INTO job_scenes SELECT seq, scene FROM jobs;
ALTER TABLE jobs DROP COLUMN scene;

ALTER TABLE jobs ADD COLUMN scene_sha256 TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN build TEXT;                           -- of the server that ran the last attempt
ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;  -- higher ones first
ALTER TABLE jobs ADD COLUMN tags TEXT NOT NULL DEFAULT '[]';      -- JSON; job_tags is for searching
ALTER TABLE jobs ADD COLUMN deadline INTEGER;                     -- not started by then: failed
ALTER TABLE jobs ADD COLUMN estimate_s REAL;                      -- wall time foretold
ALTER TABLE jobs ADD COLUMN sweep TEXT;

CREATE TABLE job_tags (
    tag TEXT    NOT NULL,
    seq INTEGER NOT NULL REFERENCES jobs (seq) ON DELETE CASCADE,
    PRIMARY KEY (tag, seq)
) STRICT, WITHOUT ROWID;

CREATE TABLE sweeps (
    id         TEXT    PRIMARY KEY,
    name       TEXT    NOT NULL,
    created_at INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX jobs_in_queue ON jobs (priority DESC, seq) WHERE status = 'queued';
CREATE INDEX jobs_by_deadline ON jobs (deadline) WHERE status = 'queued';
CREATE INDEX jobs_by_name ON jobs (name, seq);
CREATE INDEX jobs_by_creation ON jobs (created_at, seq);
CREATE INDEX jobs_by_end ON jobs (finished_at, seq);
CREATE INDEX jobs_by_sweep ON jobs (sweep, seq) WHERE sweep IS NOT NULL;
CREATE INDEX jobs_by_scene ON jobs (scene_sha256, seq) WHERE status = 'succeeded';
CREATE INDEX job_tags_by_job ON job_tags (seq);
