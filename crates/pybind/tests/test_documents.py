"""The examples of docs/python.md and of the package's README run as they stand."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
DOCUMENTS = [PACKAGE.parents[1] / "docs" / "python.md", PACKAGE / "README.md"]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_examples_run(
    document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", document.read_text(), re.DOTALL)
    assert blocks
    # Not the main module: the example of many processes is read and not started.
    names: dict[str, object] = {"__name__": "example"}
    for block in blocks:
        # The plot needs matplotlib, which the package does not.
        if "matplotlib" in block and find_spec("matplotlib") is None:
            continue
        exec(compile(block, str(document), "exec"), names)
    printed = capsys.readouterr().out
    if document.name == "python.md":
        right, heavy = (float(n) for n in re.findall(r": (\d+) N", printed)[:2])
        assert heavy > right
