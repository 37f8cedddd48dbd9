"""Validates Kubernetes manifests against the published schemas of a version, strictly: `VERSION FILE`.

Prints how many documents there are. A kind without a schema is an error.
"""

import sys

import kubernetes_validate
import yaml

version, file = sys.argv[1:]
with open(file) as text:
    documents = [document for document in yaml.safe_load_all(text) if document is not None]
for document in documents:
    kubernetes_validate.validate(document, version, strict=True)
print(len(documents))
