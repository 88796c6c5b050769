"""Every public name has a stub, a docstring and a test; stubs say what is so."""

import ast
import inspect
import pathlib
import re
import subprocess
import sys

import fabrig
import pytest

import sample_whole_api

HERE = pathlib.Path(__file__).parent
PACKAGE = pathlib.Path(fabrig.__file__).parent
MODULES = {"fabrig": fabrig, "fabrig.bench": fabrig.bench}


def public_names():
    """(module or class, member, object) of everything that users see."""
    for module_name, module in MODULES.items():
        for name in module.__all__:
            value = getattr(module, name)
            yield module_name, name, value
            if inspect.isclass(value) and not issubclass(value, Exception):
                for member in vars(value):
                    if not member.startswith("_"):
                        yield f"{module_name}.{name}", member, getattr(value, member)


NAMES = list(public_names())
CALLABLES = [(f"{owner}.{name}", v) for owner, name, v in NAMES if name != "__version__"]


def test_all_is_sorted_and_there():
    for module in MODULES.values():
        assert module.__all__ == sorted(module.__all__)
    # Whatever the native module has is public, but for what `fabrig.bench` wraps.
    native = {n for n in vars(fabrig._fabrig) if not n.startswith("_")}
    hidden = {n for n in native - set(fabrig.__all__) if not n.startswith("bench_")}
    assert hidden == set()
    wrapped = {n.removeprefix("bench_") for n in native if n.startswith("bench_")}
    assert wrapped == set(fabrig.bench.__all__)


@pytest.mark.parametrize("name, value", CALLABLES, ids=[name for name, _ in CALLABLES])
def test_a_docstring_says_what_it_is(name, value):
    if name in ("fabrig.ARKIT_SHAPES",):
        return
    text = inspect.getdoc(value)
    assert text and len(text) > 4 and text[0].isupper(), name
    if inspect.isclass(value) and issubclass(value, Exception):
        return
    first = text.split("\n\n")[0]
    assert first.rstrip()[-1] in ".:)]`", f"{name}: {first}"


def test_arguments_are_told_in_docstrings():
    lacking = []
    for name, value in CALLABLES:
        signature = getattr(value, "__text_signature__", None)
        if not signature or not callable(value):
            continue
        arguments = re.findall(r"(\w+)(?==|,|\))", signature.replace("$self", "").replace("/", ""))
        text = inspect.getdoc(value)
        if len(arguments) < 3:
            continue
        known = set(re.findall(r"`(\w+)`", text))
        lacking += [f"{name}: {a}" for a in arguments if a not in known and a not in ("self",) and a.isidentifier()
                    and not a[0].isdigit() and a not in ("True", "False", "None")]
    assert lacking == []


def stub_names():
    tree = ast.parse((PACKAGE / "_fabrig.pyi").read_text())
    names = set()
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        if isinstance(node, ast.AnnAssign):
            names.add(node.target.id)
        if isinstance(node, ast.ClassDef):
            members = (m.name for m in node.body if isinstance(m, ast.FunctionDef))
            names.update(f"{node.name}.{m}" for m in members)
    return names


def test_every_name_has_a_stub():
    names = stub_names()
    inline = {"batch", "bench", "log_to_rerun"}  # Python with types of its own
    for owner, name, _ in NAMES:
        path = f"{owner}.{name}".removeprefix("fabrig.")
        if not path.startswith("bench") and path not in inline:
            assert path in names, path
    assert (PACKAGE / "py.typed").exists()


def test_every_name_is_tested():
    files = [*HERE.glob("*.py"), *(HERE.parents[2] / "tests").glob("*.py")]
    text = "\n".join(path.read_text() for path in files if path != pathlib.Path(__file__))
    untested = [
        f"{owner}.{name}" for owner, name, _ in NAMES if not re.search(rf"\.{name}\b", text)
    ]
    assert untested == []


@pytest.mark.parametrize("part", sample_whole_api.PARTS, ids=lambda part: part.__name__)
def test_the_sample_of_everything_runs(part, rig, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    part(rig, tmp_path)


def run(*command):
    done = subprocess.run(
        [sys.executable, "-m", *map(str, command)], capture_output=True, text=True, cwd=HERE
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_mypy_accepts_it_strictly(tmp_path):
    pytest.importorskip("mypy")
    cache = ["--cache-dir", tmp_path]
    run("mypy", "--strict", *cache, HERE / "sample_whole_api.py")
    run("mypy", "--strict", *cache, "-p", "fabrig")


def test_pyright_accepts_it():
    pytest.importorskip("pyright")
    run("pyright", "--pythonpath", sys.executable, HERE / "sample_whole_api.py")


def test_stubs_say_what_the_module_does():
    pytest.importorskip("mypy")
    run("mypy.stubtest", "fabrig", "--ignore-disjoint-bases")
