from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import twofold
from twofold import _core

PACKAGE = Path(twofold.__file__).parent


def check(*command: str) -> None:
    done = subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr


def test_mypy_finds_nothing_to_say() -> None:
    pytest.importorskip("mypy")
    tests = [str(file) for file in Path(__file__).parent.glob("*.py")]
    check("mypy", "--strict", "--cache-dir=/dev/null", str(PACKAGE))
    check("mypy", "--strict", "--cache-dir=/dev/null", *tests)


def test_the_stub_describes_what_is_there() -> None:
    stub = ast.parse((PACKAGE / "_core.pyi").read_text())
    classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef)}

    def described(node: ast.ClassDef) -> set[str]:
        names = {member.name for member in node.body if isinstance(member, ast.FunctionDef)}
        names |= {ast.unparse(member.target) for member in node.body if isinstance(member, ast.AnnAssign)}
        return names.union(*(described(classes[ast.unparse(base)]) for base in node.bases))

    there = {name: value for name, value in vars(_core).items() if isinstance(value, type)}
    assert set(classes) - {"_Enum"} == set(there)
    for name, value in there.items():
        assert described(classes[name]) - set(vars(value)) <= {"__init__", "__eq__", "__hash__"}, name
        assert {member for member in vars(value) if not member.startswith("_")} <= described(classes[name]), name


def test_options_are_typed(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text("import twofold\n\ndef f(rig: twofold.CameraRig) -> None:\n    twofold.Slam(rig, inner=3)\n")
    with pytest.raises(AssertionError, match='Unexpected keyword argument "inner"'):
        check("mypy", "--strict", "--cache-dir=/dev/null", str(tmp_path / "user.py"))
