"""What the Python package jsonschema has against documents: for each the number of errors, and where the best match is.

python schema.py SCHEMA.json DOCUMENTS.json
"""

import json
import sys

import jsonschema

schema, documents = (json.load(open(path)) for path in sys.argv[1:])
jsonschema.Draft202012Validator.check_schema(schema)
validator = jsonschema.Draft202012Validator(schema)


def judge(document):
    errors = list(validator.iter_errors(document))
    best = jsonschema.exceptions.best_match(errors)
    return [len(errors), "".join(f"/{step}" for step in best.absolute_path) if best else ""]


json.dump([judge(document) for document in documents], sys.stdout)
