"""The files around the source keep their promises."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

COMMANDS = ("setup", "demo", "serve", "test", "test-slow", "faults", "bench", "check")


def test_constraints_pin_every_dependency(root: Path) -> None:
    """Each direct dependency is pinned to one version, and no index address is named."""
    text = (root / "constraints.txt").read_text()
    assert not re.search(r"https?:|--|@ ", text)
    pinned = {
        line.partition("==")[0].strip().lower().replace("_", "-")
        for line in text.splitlines()
        if "==" in line
    }
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"]]
    for extra in project["optional-dependencies"].values():
        wanted += extra
    names = {re.split(r"[\[<>=;! ]", entry)[0].lower().replace("_", "-") for entry in wanted}
    assert names - pinned - {project["name"]} == set(), "an extra may be made of others"


def test_make_has_the_promised_targets(root: Path) -> None:
    """Every command that the papers name is a target."""
    text = (root / "Makefile").read_text()
    targets = set(re.findall(r"^([a-z-]+):", text, flags=re.MULTILINE))
    assert set(COMMANDS) <= targets
    for paper in ("README.md", "CONTRIBUTING.md"):
        named = set(re.findall(r"(?:    |`)make ([a-z-]+)", (root / paper).read_text()))
        assert named <= targets, f"{paper} names targets that are not there"


@pytest.mark.parametrize("paper", ["README.md", "CONTRIBUTING.md", "examples/clients/README.md"])
def test_links_lead_somewhere(root: Path, paper: str) -> None:
    """Every relative link in a paper names a file that is there."""
    folder = (root / paper).parent
    links = re.findall(r"\]\(([^)#]+)\)", (root / paper).read_text())
    missing = [link for link in links if "://" not in link and not (folder / link).exists()]
    assert missing == []


def test_compose_describes_the_whole_service(root: Path) -> None:
    """Api, worker, beat, redis and postgres each have a health check and come up in order."""
    services = yaml.safe_load((root / "docker-compose.yml").read_text())["services"]
    assert {"api", "worker", "beat", "redis", "postgres"} <= set(services)
    for name in ("api", "worker", "beat", "redis", "postgres"):
        assert services[name]["healthcheck"]["test"][0] in {"CMD", "CMD-SHELL"}, name
    for name in ("api", "worker", "beat"):
        assert services[name]["depends_on"]["migrate"]["condition"] == "service_completed_successfully"
        assert services[name]["environment"]["MORPHID_DATABASE_URL"].startswith("postgresql://")
    assert services["api"]["ports"] == ["127.0.0.1:8000:8000"], "published on loopback only"


def test_compose_settings_are_accepted(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment of each service passes the settings' own checks."""
    from app.settings import load_settings

    services = yaml.safe_load((root / "docker-compose.yml").read_text())["services"]
    for name in ("api", "worker", "beat"):
        with monkeypatch.context() as patch:
            for key, value in services[name]["environment"].items():
                patch.setenv(key, re.sub(r"\$\{[A-Z_]+:-([^}]*)\}", r"\1", value))
            settings = load_settings()
        assert settings.broker_url == "redis://redis:6379/0"


def test_the_image_holds_what_it_runs(root: Path) -> None:
    """Every package that is installed is copied into the image, which does not run as root."""
    text = (root / "Dockerfile").read_text()
    for package in ("app", "cli", "migrations", "morphcore", "worker"):
        assert f"COPY {package} {package}" in text
    assert "USER morphid" in text
