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


def test_the_stub_has_the_modules_docstrings() -> None:
    script = Path(__file__).parents[2] / "scripts" / "stub"
    stub = PACKAGE / "_core.pyi"
    written = subprocess.run([sys.executable, str(script), str(stub)], capture_output=True, text=True, timeout=60)
    assert written.returncode == 0, written.stderr
    assert stub.read_text() == written.stdout, "scripts/stub writes them"


def documented(value: object) -> bool:
    """Has a docstring of more than the signatures that pybind11 writes."""
    lines = (getattr(value, "__doc__", None) or "").splitlines()
    return any(line.strip() and "->" not in line and not line.startswith("Overloaded") for line in lines)


def test_help_says_what_everything_is() -> None:
    missing = []
    for name in set(twofold.__all__) - {"__version__"}:
        public = getattr(twofold, name)
        missing += [] if documented(public) else [name]
        if not isinstance(public, type):
            continue
        members = {member for member in dir(public) if not member.startswith("_")} - set(dir(int))
        members -= {"name", "value"} if hasattr(public, "__members__") else set()  # pybind11's own
        missing += [f"{name}.{member}" for member in members if not documented(getattr(public, member))]
    assert sorted(missing) == []


def test_a_processor_that_is_too_old_is_an_import_error(tmp_path: Path) -> None:
    from twofold import _cpu

    _cpu.check(level="x86-64-v3")  # what runs this
    # Without abm, which kernels of virtual machines leave out.
    modern = "flags\t\t: fpu cx16 lahf_lm popcnt pni sse4_1 sse4_2 ssse3 avx avx2 bmi1 bmi2 f16c fma movbe xsave\n"
    (tmp_path / "modern").write_text(modern)
    _cpu.check(str(tmp_path / "modern"), "x86-64-v3")
    (tmp_path / "old").write_text(modern.replace(" avx2", ""))
    with pytest.raises(ImportError, match="x86-64-v3.*(avx2).*release-v2"):
        _cpu.check(str(tmp_path / "old"), "x86-64-v3")
    _cpu.check(str(tmp_path / "old"), "x86-64-v2")
    _cpu.check(str(tmp_path / "none"), "x86-64-v3")  # the library looks for itself


def test_options_are_typed(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text("import twofold\n\ndef f(rig: twofold.CameraRig) -> None:\n    twofold.Slam(rig, inner=3)\n")
    with pytest.raises(AssertionError, match='Unexpected keyword argument "inner"'):
        check("mypy", "--strict", "--cache-dir=/dev/null", str(tmp_path / "user.py"))
