-- A sweep, too, is accepted once under an idempotency key. Older ones had none.
ALTER TABLE sweeps ADD COLUMN idempotency_key TEXT;
ALTER TABLE sweeps ADD COLUMN request_sha256 TEXT NOT NULL DEFAULT '';
CREATE UNIQUE INDEX sweeps_by_key ON sweeps (idempotency_key);
