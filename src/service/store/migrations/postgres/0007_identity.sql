-- Who this database is: an object storage keeps the files of one.
CREATE TABLE identity (id TEXT NOT NULL);
INSERT INTO identity VALUES (replace(gen_random_uuid()::text, '-', ''));
