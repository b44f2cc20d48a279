"""Laws of the addresses that webhooks may have."""

from __future__ import annotations

import asyncio
import ipaddress
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.webhooks.addresses import AddressPolicy, AddressRefused, is_public

PUBLIC = ("8.8.8.8", "1.1.1.1", "2606:4700::1111", "::ffff:8.8.8.8", "64:ff9b::808:808", "2002:808:808::1")
INSIDE = (
    "0.0.0.0",  # noqa: S104 - an address to be refused
    "10.1.2.3",
    "100.64.0.1",
    "100.100.100.200",
    "127.0.0.1",
    "127.255.255.254",
    "168.63.129.16",
    "169.254.169.254",
    "172.16.0.1",
    "192.0.0.9",
    "192.0.2.1",
    "192.88.99.1",
    "192.168.1.1",
    "198.18.0.1",
    "224.0.0.1",
    "233.252.0.1",
    "240.0.0.1",
    "255.255.255.255",
    "::",
    "::1",
    "::7f00:1",
    "::ffff:127.0.0.1",
    "::ffff:169.254.169.254",
    "64:ff9b::7f00:1",
    "64:ff9b::a9fe:a9fe",
    "64:ff9b:1::808:808",
    "100::1",
    "2001::1",
    "2001:db8::1",
    "2002:7f00:1::",
    "2002:a00:1::1",
    "3fff::1",
    "5f00::1",
    "fc00::1",
    "fd00:ec2::254",
    "fe80::1",
    "fe80::1%eth0",
    "fec0::1",
    "ff02::1",
)
V4_INSIDE = [address for address in INSIDE if ":" not in address]


@pytest.mark.parametrize("address", PUBLIC)
def test_global_unicast_is_public(address: str) -> None:
    """Addresses that anyone can reach are let through, however they are wrapped."""
    assert is_public(ipaddress.ip_address(address))


@pytest.mark.parametrize("address", INSIDE)
def test_nothing_inside_is_public(address: str) -> None:
    """No address of this machine, its networks, its cloud or for a special use is public."""
    assert not is_public(ipaddress.ip_address(address))


@pytest.mark.parametrize("address", V4_INSIDE)
def test_wrapping_changes_nothing(address: str) -> None:
    """An IPv4 address inside IPv6 (mapped, NAT64, 6to4) is judged as what it is."""
    number = int(ipaddress.IPv4Address(address))
    mapped = ipaddress.IPv6Address((0xFFFF << 32) | number)
    nat64 = ipaddress.IPv6Address((0x0064FF9B << 96) | number)
    sixtofour = ipaddress.IPv6Address((0x2002 << 112) | (number << 80) | 1)
    assert not any(is_public(wrapped) for wrapped in (mapped, nat64, sixtofour))


@given(st.ip_addresses(v=6))
def test_public_ipv6_is_global_unicast(address: ipaddress.IPv6Address) -> None:
    """What passes lies in 2000::/3, or wraps an IPv4 address that passes."""
    wrapped = address.ipv4_mapped or address in ipaddress.ip_network("64:ff9b::/96")
    if is_public(address):
        assert wrapped or address in ipaddress.ip_network("2000::/3")


def resolving(*addresses: str) -> AddressPolicy:
    """A policy whose every name has these addresses."""
    return AddressPolicy(resolve=lambda _host, _port: list(addresses))


BAD_URLS = (
    "http://example.com/",
    "ftp://example.com/",
    "file:///etc/passwd",
    "gopher://example.com/",
    "//example.com/",
    "example.com",
    "https://",
    "https:///path",
    "https://user@example.com/",
    "https://user:word@example.com/",
    "https://@example.com/",
    "https://example.com/#part",
    "https://example.com:22/",
    "https://example.com:80/",
    "https://example.com:0/",
    "https://example.com:99999/",
    "https://example.com:https/",
    "https://exa mple.com/",
    "https://example.com\\@127.0.0.1/",
    "https://example.com/\r\nX: 1",
    "https://exämple.com/",
    "https://127.0.0.1/",
    "https://127.1/",
    "https://2130706433/",
    "https://0x7f000001/",
    "https://0177.0.0.1/",
    "https://[::1]/",
    "https://[::ffff:127.0.0.1]/",
    "https://[::ffff:a9fe:a9fe]/",
    "https://[fe80::1%25eth0]/",
    "https://169.254.169.254/latest/meta-data/",
    "https://[::1/",
    "https://.example.com/",
    "https://example.com/" + "a" * 2000,
)


@pytest.mark.parametrize("url", BAD_URLS)
def test_bad_urls_are_refused_before_any_look_up(url: str) -> None:
    """Other schemes, names and passwords, odd ports, disguised addresses: refused without a look-up."""
    requested: list[str] = []

    def resolve(host: str, _port: int) -> list[str]:
        requested.append(host)
        return ["8.8.8.8"]

    with pytest.raises(AddressRefused):
        AddressPolicy(resolve=resolve).check_now(url)
    assert requested == []


@pytest.mark.parametrize(
    "url",
    ["https://example.com", "https://example.com:8443/a?b=c", "https://8.8.8.8/", "https://[2606:4700::1]/"],
)
def test_honest_urls_pass(url: str) -> None:
    """A public https address passes."""
    resolving("8.8.8.8").check_now(url)


@pytest.mark.parametrize(
    "found", [["127.0.0.1"], ["8.8.8.8", "10.0.0.1"], ["8.8.8.8", "::1"], [], ["nonsense"]]
)
def test_one_bad_address_is_enough(found: list[str]) -> None:
    """A name any of whose addresses lies inside is refused, at creation and at sending."""
    policy = resolving(*found)
    with pytest.raises(AddressRefused):
        policy.check_now("https://example.com/")
    with pytest.raises(AddressRefused):
        asyncio.run(policy.target("https://example.com/"))


def test_development_opens_loopback_and_nothing_of_the_cloud() -> None:
    """With private addresses allowed, plain http goes to loopback alone, and metadata stay out of reach."""
    policy = AddressPolicy(allow_private=True, resolve=lambda _host, _port: ["10.0.0.1"])
    policy.check_now("https://intranet.example/")
    policy.check_url("http://127.0.0.1:8080/")
    for url in (
        "http://intranet.example/",
        "http://localhost/",
        "https://169.254.169.254/",
        "https://[fe80::1]/",
    ):
        with pytest.raises(AddressRefused):
            policy.check_now(url)  # here "localhost" is said to be 10.0.0.1


def test_a_name_server_that_hangs_holds_nobody_up() -> None:
    """Waiting for an address ends with the sender's patience, not with the resolver's."""
    hold = threading.Event()

    def resolve(_host: str, _port: int) -> list[str]:
        hold.wait(30.0)
        return ["8.8.8.8"]

    async def impatient() -> None:
        async with asyncio.timeout(0.1):
            await AddressPolicy(resolve=resolve).target("https://example.com/")

    with pytest.raises(TimeoutError):
        asyncio.run(impatient())
    hold.set()


@pytest.mark.parametrize(
    ("url", "named"),
    [
        ("https://hooks.example.com/a", True),
        ("https://HOOKS.example.com:8443/a", True),
        ("https://other.example.com:9000/", True),
        ("https://[2606:4700::1]/", True),
        ("https://other.example.com/", False),
        ("https://other.example.com:9001/", False),
        ("https://hooks.example.com.evil.example/", False),
        ("https://8.8.8.8/", False),
    ],
)
def test_only_named_hosts_are_looked_up(url: str, named: bool) -> None:  # noqa: FBT001
    """Where hosts are named no other is looked up, neither at creation nor at a try."""
    requested: list[str] = []

    def resolve(host: str, _port: int) -> list[str]:
        requested.append(host)
        return ["8.8.8.8"]

    names = frozenset({"hooks.example.com", "other.example.com:9000", "[2606:4700::1]"})
    policy = AddressPolicy(resolve=resolve, dial_only=names)
    if named:
        policy.check_now(url)
        asyncio.run(policy.target(url))
        return
    with pytest.raises(AddressRefused, match="certain hosts"):
        policy.check_now(url)
    with pytest.raises(AddressRefused, match="certain hosts"):
        asyncio.run(policy.target(url))
    assert requested == []
