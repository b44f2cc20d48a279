"""The files around the source keep their promises."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

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
                value = re.sub(r"\$\{MORPHID_(\w+)_PASSWORD:\?[^}]*\}", r"chosen-\1", value)  # noqa: PLW2901
                patch.setenv(key, re.sub(r"\$\{[A-Z_]+:-([^}]*)\}", r"\1", value))
            settings = load_settings()
        assert settings.broker_url == "redis://:chosen-BROKER@redis:6379/0"


def test_compose_confines_its_containers(root: Path) -> None:
    """No new privileges, no capabilities, read-only files, bounds of memory and processes; nobody is root."""
    services = yaml.safe_load((root / "docker-compose.yml").read_text("utf-8"))["services"]
    for name, service in services.items():
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["cap_drop"] == ["ALL"], name
        assert "cap_add" not in service, name
        assert service["read_only"] is True, name
        assert "/tmp" in service["tmpfs"], name  # noqa: S108 - the container's own
        assert re.fullmatch(r"(\$\{\w+:-)?\d+[mg]\}?", service["mem_limit"]), name
        assert 16 <= service["pids_limit"] <= 512, name
        assert service["image"] == "morphid" or service["user"] == name, name


def test_images_are_named_by_their_content(root: Path) -> None:
    """A tag can be moved to another image; each default is a digest, and an operator can choose another."""
    compose = yaml.safe_load((root / "docker-compose.yml").read_text("utf-8"))["services"]
    base = compose["api"]["build"]["args"]["PYTHON_IMAGE"]
    by_content = r"\$\{[A-Z]+_IMAGE:-([a-z]+:[\w.-]+@sha256:[0-9a-f]{64})\}"
    for image in (compose["postgres"]["image"], compose["redis"]["image"], base):
        assert re.fullmatch(by_content, image), image
    dockerfile = (root / "Dockerfile").read_text("utf-8")
    assert f"ARG PYTHON_IMAGE={re.fullmatch(by_content, base)[1]}\n" in dockerfile  # type: ignore[index]
    assert re.findall(r"^FROM (\S+)", dockerfile, re.MULTILINE) == ["${PYTHON_IMAGE}"] * 2


def hashed(root: Path) -> dict[str, tuple[Requirement, list[str]]]:
    """Packages of requirements-server.txt, each with its hashes."""
    text = (root / "requirements-server.txt").read_text("utf-8").replace("\\\n", " ")
    found = {}
    for line in text.splitlines():
        if not line.startswith("#"):
            requirement, *hashes = re.split(r"\s+--hash=", line)
            parsed = Requirement(requirement)
            found[canonicalize_name(parsed.name)] = (parsed, hashes)
    return found


def test_the_service_s_packages_have_hashes(root: Path) -> None:
    """Each is the version of constraints.txt, with hashes of its files; no index address is named."""
    text = (root / "requirements-server.txt").read_text("utf-8")
    assert not re.search(r"https?:|--(?!hash=sha256:|require-hashes)|@ ", text)
    lines = (root / "constraints.txt").read_text("utf-8").splitlines()
    pins = {canonicalize_name(each.name): each for each in map(Requirement, filter(None, lines))}
    for name, (requirement, hashes) in hashed(root).items():
        assert str(requirement.specifier) == str(pins[name].specifier), name
        assert hashes, name
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", each.strip()) for each in hashes), name


@pytest.mark.parametrize("machine", ["x86_64", "aarch64"])
@pytest.mark.parametrize("version", ["3.11.0", "3.11.16", "3.13.1"])
def test_nothing_that_the_service_needs_is_without_a_hash(root: Path, version: str, machine: str) -> None:
    """What the extra [server] leads to, on every Linux and Python, and what builds it."""
    environment = {
        **default_environment(),
        "python_version": version.rpartition(".")[0],
        "python_full_version": version,
        "platform_machine": machine,
        "sys_platform": "linux",
        "platform_system": "Linux",
        "os_name": "posix",
    }
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))
    waiting = [
        *map(Requirement, project["build-system"]["requires"]),
        *map(Requirement, project["project"]["dependencies"]),
        *map(Requirement, project["project"]["optional-dependencies"]["server"]),
    ]
    there, seen = hashed(root), set()
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        if (name, *wanted.extras) in seen or not (
            wanted.marker is None
            or any(wanted.marker.evaluate({**environment, "extra": extra}) for extra in ("", "server"))
        ):
            continue
        seen.add((name, *wanted.extras))
        assert name in there, f"{name} is needed: make locked"
        requirement, _ = there[name]
        assert requirement.marker is None or requirement.marker.evaluate(environment), name
        assert wanted.specifier.contains(str(requirement.specifier).removeprefix("=="), prereleases=True), (
            name
        )
        try:
            further = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # not for this machine
        for each in map(Requirement, further):
            extras = ("", *wanted.extras)
            if each.marker is None or any(each.marker.evaluate({**environment, "extra": e}) for e in extras):
                each.marker = None
                waiting.append(each)


def test_the_image_takes_only_packages_with_hashes(root: Path) -> None:
    """Every `pip install` of the Dockerfile demands hashes or fetches nothing."""
    installs = re.findall(r"pip install (.*)", (root / "Dockerfile").read_text("utf-8"))
    assert len(installs) == 2
    assert "--require-hashes -r requirements-server.txt" in installs[0]
    assert "--no-deps --no-build-isolation" in installs[1]


def test_the_image_holds_what_it_runs(root: Path) -> None:
    """Every package that is installed is copied into the image, which does not run as root."""
    text = (root / "Dockerfile").read_text()
    for package in ("app", "morphid", "migrations", "morphcore", "worker"):
        assert f"COPY {package} {package}" in text
    assert "USER morphid" in text
