-- Who runs a job, until when, and how often that has gone wrong.
ALTER TABLE jobs RENAME COLUMN lost_attempts TO deaths; -- in a row, without a newer checkpoint between them
ALTER TABLE jobs ADD COLUMN owner TEXT; -- the server that claimed it last
-- Jobs that run while this is applied run in a server that is dead: it held the lock of the data directory.
ALTER TABLE jobs ADD COLUMN lease_until INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN checkpoint_frame INTEGER; -- the newest frame that an attempt can go on from
