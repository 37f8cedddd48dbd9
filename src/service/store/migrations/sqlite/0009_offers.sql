-- An attempt that was offered to a cluster's scheduler.
ALTER TABLE jobs ADD COLUMN cluster_job TEXT;        -- the scheduler's name of it
ALTER TABLE jobs ADD COLUMN offered_attempt INTEGER; -- its number, until the scheduler has nothing of it any more
CREATE INDEX jobs_by_offer ON jobs (seq) WHERE offered_attempt IS NOT NULL;
