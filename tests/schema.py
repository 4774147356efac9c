"""Are real models as docs/model.schema.json says? Needs the package jsonschema.

usage: schema.py PROGRAM
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import jsonschema

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "examples/data/encounter.csv"
CASES = [
    [],
    ["--method", "pcmci", "--test", "parcorr", "--tau-max", "3", "--fdr"],
    ["--method", "pcmciplus", "--test", "parcorr", "--tau-max", "2"],
    ["--method", "lpcmci", "--test", "parcorr"],
    ["--method", "granger"],
    ["--method", "varlingam"],
    ["--method", "dynotears"],
    ["--method", "timino", "--test", "parcorr"],
    ["--method", "tsfci", "--test", "parcorr"],
]


def main():
    program = sys.argv[1]
    schema = json.loads((ROOT / "docs/model.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            command = [program, "discover", str(DATA), *case, "--format", "json", "--out", folder + "/out"]
            printed = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
            stored = json.loads(Path(folder, "out/model.json").read_text())
        for model in printed, stored:
            validator.validate(model)
    # The schema can say no.
    for wrong in {"graph": "none"}, {"links": [{}]}, {"n_samples": -1}, {"outcomes": [[["perhaps"]]]}, {"schema": "roscausal/model/3"}:
        assert not validator.is_valid({**printed, **wrong}), wrong
    print(f"{2 * len(CASES)} models are as their schema says")


if __name__ == "__main__":
    main()
