"""What a release says of itself: one version everywhere, one script that makes it, and no word of what is not published."""

import re

import pytest
from conftest import ROOT

import roscausal as rc

SCRIPT = (ROOT / "packaging" / "release.sh").read_text()
PARTS = re.search(r"^parts=\((.*)\)$", SCRIPT, re.M).group(1).split()


def first(pattern, *path):
    return re.search(pattern, (ROOT.joinpath(*path)).read_text(), re.M).group(1)


def test_one_version_is_everywhere():
    version = first(r'^version = "(.*)"', "Cargo.toml")
    assert rc.__version__ == version
    assert first(r"<version>(.*)</version>", "package.xml") == version
    assert first(r"<version>(.*)</version>", "roscausal_msgs", "package.xml") == version
    assert first(r"^(\d+\.\d+\.\d+) \(", "CHANGELOG.rst") == version


@pytest.mark.parametrize("part", PARTS)
def test_the_release_script_makes_and_explains_each_part(part):
    function = {"source": "source_archive"}.get(part, part)
    assert re.search(rf"^{function}\(\)", SCRIPT, re.M)
    assert re.search(rf"^#   {part}  ", SCRIPT, re.M)


def test_workflow_and_image_call_only_the_release_script():
    workflow = (ROOT / ".github" / "workflows" / "release.yml").read_text()
    runs = re.findall(r"run:\s*(.+)", workflow)
    assert runs and all(run.startswith("packaging/release.sh") for run in runs)
    image = (ROOT / "Dockerfile").read_text()
    assert re.findall(r"--only (\w+)", image) == ["deb"]


def test_nothing_is_claimed_to_be_published():
    for page in ("README.md", "docs/python.md", "roscausal_py/README.md"):
        text = (ROOT / page).read_text()
        claims = re.findall(r"(?:pip install|cargo install|apt(?:-get)? install|cargo add) +roscausal\b", text)
        assert not claims, f"{page} says {claims}"
