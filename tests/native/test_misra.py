"""MISRA C:2012 as cppcheck knows it: no finding but those of docs/export.md."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from canshaper.native.library import C_FILES, sizes_source
from canshaper.native.tables import tables
from tests.rigs.files import CONFIG, ROOT, read


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="expected cppcheck, got none")
def test_the_findings_are_those_of_the_page(tmp_path: Path) -> None:
    numbers = tables(read(CONFIG / "forwarder-robust.yaml"))
    (tmp_path / "cs_sizes.h").write_text(sizes_source(numbers))
    sources = sorted((C_FILES / "src").glob("*.c"))
    options = ("--addon=misra", "--std=c99", "--enable=style", "--quiet", f"-I{tmp_path}")
    command = ["cppcheck", *options, f"-I{C_FILES}/src", *map(str, sources)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = set(re.findall(r"\[(?:misra-c2012-)?(.+?)\]$", done.stderr, re.MULTILINE))
    text = (ROOT / "docs/export.md").read_text(encoding="utf-8")
    page = text.partition("MISRA C:2012")[2].partition("By eye")[0]
    assert found == set(re.findall(r"\b\d+\.\d+\b", page))
