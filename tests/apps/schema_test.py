"""What runs write is what docs/schema/ describes:  schema_test.py PROGRAM    (77: nothing to check it with)"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import jsonschema
except ImportError:
    print("python3-jsonschema is missing")
    sys.exit(77)

SCHEMAS = Path(__file__).parents[2] / "docs" / "schema"
# A hand over the lens, from which the camera comes back: lost frames, a relocalisation, a loaded map, a pace.
SCENE = "synthetic:desk?frames=90&width=320&height=240&cover_at=1&cover=0.5"


# 35 degrees of two turns, and too few to tell an axis.
OBJECT = "synthetic:turntable?sensor=rgbd&frames={}"


def schema_of(name: str) -> dict:
    return json.loads((SCHEMAS / f"{name}.schema.json").read_text())


def check(folder: Path, *names: str) -> None:
    for name in names:
        schema = schema_of(name)
        jsonschema.Draft202012Validator.check_schema(schema)
        written = json.loads((folder / f"{name}.json").read_text())
        jsonschema.validate(written, schema, cls=jsonschema.Draft202012Validator)
        if "additionalProperties" in schema or "patternProperties" in schema:
            continue  # it says itself what else there may be
        assert set(written) <= set(schema["properties"]), f"{name}: {set(written) - set(schema['properties'])} is described nowhere"


with tempfile.TemporaryDirectory() as folder:
    out = Path(folder)
    for options in ["--deterministic", "--save-map", f"{out}/map.tfm"], ["--speed", "4", "--load-map", f"{out}/map.tfm"]:
        subprocess.run([sys.argv[1], "run", SCENE, "--quiet", "--out", folder, *options], check=True, stdout=subprocess.DEVNULL)
        check(out, "summary", "timing")
        if "--deterministic" in options:
            assert json.loads((out / "summary.json").read_text())["why_lost"], "the scene has lost frames"

with tempfile.TemporaryDirectory() as folder:
    subprocess.run([sys.argv[1], "run", "synthetic:desk?frames=10&width=320&height=240", "--estimator", "swf", "--out", folder], check=True, stdout=subprocess.DEVNULL)
    check(Path(folder), "summary")

for frames, turns in (30, True), (8, False):
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([sys.argv[1], "object", OBJECT.format(frames), "--deterministic", "--out", folder], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        assert done.returncode == (0 if turns else 1), f"{frames} frames: exit code {done.returncode}"
        assert (Path(folder) / "object.json").exists() == turns
        if turns:
            check(Path(folder), "object")
            assert json.loads((Path(folder) / "object.json").read_text())["axis"] is not None

in_summary = schema_of("summary")["properties"]["surface"]["oneOf"][1]
assert schema_of("object")["properties"]["surface"] == in_summary, "a surface is described alike in both"
