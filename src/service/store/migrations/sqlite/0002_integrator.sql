-- How a job is integrated, and why. Older ones had no choice.
ALTER TABLE jobs ADD COLUMN integrator TEXT NOT NULL DEFAULT 'explicit';
ALTER TABLE jobs ADD COLUMN integrator_reason TEXT NOT NULL DEFAULT 'accepted when there was no other';
