"""Nodes in a domain of their own, and a network of this process."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import pytest

from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network
from rtf.ros2.node import Node

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@pytest.fixture(scope="session")
def domain() -> int:
    """A domain for this process: several may run tests at the same time."""
    return 1 + os.getpid() % 200


@pytest.fixture
def node(domain: int) -> Iterator[Callable[..., Node]]:
    """Make nodes; they are closed."""
    made: list[Node] = []

    def make(name: str, namespace: str = "/", **options: Any) -> Node:
        made.append(Node(name, namespace, domain=domain, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def network() -> Network:
    """A network whose names are known to this process only."""
    return Network(LocalNames())
