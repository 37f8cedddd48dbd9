-- What a sweep put in the place of the scene's values, as JSON. Of older jobs it is not known.
ALTER TABLE jobs ADD COLUMN sweep_values TEXT NOT NULL DEFAULT '{}';
