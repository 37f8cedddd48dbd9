-- What the user should know of the scene, as JSON. Older ones had none.
ALTER TABLE jobs ADD COLUMN notices TEXT NOT NULL DEFAULT '[]';
