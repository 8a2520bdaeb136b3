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
OBJECT = "synthetic:turntable?sensor=rgbd&frames=60"


def check(folder: Path, *names: str) -> None:
    for name in names:
        schema = json.loads((SCHEMAS / f"{name}.schema.json").read_text())
        jsonschema.Draft202012Validator.check_schema(schema)
        written = json.loads((folder / f"{name}.json").read_text())
        jsonschema.validate(written, schema, cls=jsonschema.Draft202012Validator)


with tempfile.TemporaryDirectory() as folder:
    out = Path(folder)
    for options in ["--deterministic", "--save-map", f"{out}/map.tfm"], ["--speed", "4", "--load-map", f"{out}/map.tfm"]:
        subprocess.run([sys.argv[1], "run", SCENE, "--quiet", "--out", folder, *options], check=True, stdout=subprocess.DEVNULL)
        check(out, "summary", "timing")
        if "--deterministic" in options:
            assert json.loads((out / "summary.json").read_text())["why_lost"], "the scene has lost frames"

with tempfile.TemporaryDirectory() as folder:
    subprocess.run([sys.argv[1], "object", OBJECT, "--deterministic", "--out", folder], check=True, stdout=subprocess.DEVNULL)
    check(Path(folder), "summary", "timing", "object")
    assert json.loads((Path(folder) / "object.json").read_text())["axis"], "the scene has a turntable"
