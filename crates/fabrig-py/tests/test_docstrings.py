"""Examples in docstrings are true."""

import doctest
import inspect
import pathlib
import re

import fabrig
import pytest

DOCUMENTS = pathlib.Path(__file__).resolve().parents[3]


def documented():
    yield "fabrig", fabrig.__doc__
    yield "fabrig.bench", fabrig.bench.__doc__
    for prefix, module in (("fabrig", fabrig), ("fabrig.bench", fabrig.bench)):
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.ismodule(value):
                continue
            yield f"{prefix}.{name}", getattr(value, "__doc__", None)
            if inspect.isclass(value):
                for member, of in vars(value).items():
                    if not member.startswith("_"):
                        yield f"{prefix}.{name}.{member}", getattr(of, "__doc__", None)


EXAMPLES = [(name, text) for name, text in documented() if text and ">>>" in text]


@pytest.mark.parametrize("name, text", EXAMPLES, ids=[name for name, _ in EXAMPLES])
def test_examples_in_docstrings_run(name, text, quick_rigs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    test = doctest.DocTestParser().get_doctest(
        inspect.cleandoc(text), {"fabrig": fabrig}, name, None, 0
    )
    assert test.examples
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    failed, _ = runner.run(test)
    assert not failed, capsys.readouterr().out


def blocks():
    """Python in the documents; the blocks of one document are one program."""
    for path in [DOCUMENTS / "README.md", *sorted(DOCUMENTS.glob("docs/**/*.md"))]:
        code = re.findall(r"```python\n(.*?)```", path.read_text(), re.S)
        # That of export.md takes long; test_export.py runs it with quicker shapes.
        if code and path.name != "export.md":
            yield str(path.relative_to(DOCUMENTS)), code


@pytest.mark.parametrize("name, code", list(blocks()), ids=[name for name, _ in blocks()])
def test_python_in_documents_runs(name, code, quick_rigs, rig, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # What documents take for there.
    fabrig.demo_face().write_obj("face.obj")
    fabrig.demo_take().between(0, 1).save("take.csv")
    rig.save("face.fabrig")
    if name == "README.md":
        # Its recording is made below, by itself.
        assert len(code[0].strip().splitlines()) <= 12
        code = code[1:]
    scope = {}
    for index, block in enumerate(code):
        exec(compile(block, f"{name}, block {index + 1}", "exec"), scope)


def test_the_readme_leaves_a_recording(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    readme = dict(blocks())["README.md"]
    exec(compile(readme[0], "README.md", "exec"), {})
    assert any(path.suffix == ".mcap" for path in tmp_path.iterdir())


def test_the_scene_in_the_formats_is_the_default_one(tmp_path):
    text = (DOCUMENTS / "docs/formats.md").read_text()
    (scene,) = re.findall(r"```toml\n(.*?)```", text, re.S)
    (tmp_path / "scene.toml").write_text(scene)
    assert fabrig.read_scene(tmp_path / "scene.toml") == fabrig.read_scene()


def test_edits_in_the_guide_are_accepted(rig, tmp_path):
    text = (DOCUMENTS / "docs/guide/4_edit.md").read_text()
    (edits,) = re.findall(r"```toml\n(.*?)```", text, re.S)
    (tmp_path / "face.edits.toml").write_text(edits)
    assert rig.with_edits(tmp_path / "face.edits.toml").alphas["malar_fat_l"] == 1.2


def test_links_in_documents_lead_somewhere():
    wrong = []
    for path in [*DOCUMENTS.glob("*.md"), *DOCUMENTS.glob("docs/**/*.md")]:
        for target in re.findall(r"\]\(([^)#\s]+)", path.read_text()):
            if "://" not in target and not (path.parent / target).exists():
                wrong.append(f"{path.relative_to(DOCUMENTS)}: {target}")
    assert wrong == []
