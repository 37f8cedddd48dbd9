-- An attempt that was offered to a cluster's scheduler.
ALTER TABLE jobs ADD COLUMN cluster_job TEXT;        -- the scheduler's name of it
ALTER TABLE jobs ADD COLUMN offered_attempt INTEGER; -- its number, until the scheduler has nothing of it any more
CREATE INDEX jobs_by_offer ON jobs (seq) WHERE offered_attempt IS NOT NULL;

-- What the scheduler may still have of jobs that were deleted, until it was told.
CREATE TABLE cluster_leftovers (
    id          TEXT NOT NULL PRIMARY KEY,
    sweep       TEXT,
    cluster_job TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TRIGGER offer_left AFTER DELETE ON jobs WHEN OLD.offered_attempt IS NOT NULL BEGIN
    INSERT INTO cluster_leftovers (id, sweep, cluster_job) VALUES (OLD.id, OLD.sweep, OLD.cluster_job);
END;
