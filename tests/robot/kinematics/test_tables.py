"""The file of tables: versions, and errors with file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtf.robot.errors import RefusedError
from rtf.robot.kinematics import ChainTables, robot_chains
from rtf.robot.model import RobotModelError, load_robot

TEXT = """schema = 1
[frames]
floor = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.5]]
[links]
shoulder = { a = 0.3, limits = [-90.0, 90.0] }
elbow = { a = 0.2, alpha = 90.0, limits = [0.0, 120.0] }
[constraints]
both = { joints = { shoulder = 1.0, elbow = 1.0 }, upper = 150.0 }
[chains.arm]
"1.0" = { base = "floor", links = ["shoulder", "elbow"], constraints = ["both"] }
"1.10" = { base = "floor", links = ["shoulder", "elbow"], blocked = { elbow = 90.0 } }
"""


def read(folder: Path, old: str = "", new: str = "") -> ChainTables:
    """Read the file with one change."""
    assert old in TEXT
    path = folder / "chains.toml"
    path.write_text(TEXT.replace(old, new) if old else TEXT, encoding="utf-8")
    return ChainTables(path)


def test_versions(tmp_path: Path):
    """A version is that of the highest table up to it; the number after the dot is a whole one."""
    tables = read(tmp_path)
    assert tables.names == ("arm",)
    assert tables.versions("arm") == ("1.0", "1.10")
    for version, joints in (("1.0", 2), ("1.9", 2), ("v1.10", 1), ("2.5", 1), ("0.5", 2)):
        assert len(tables.chain("arm", version)) == joints
    pose = tables.chain("arm", "1.10").pose([0.0])
    assert pose[:3, 3].round(12).tolist() == [0.3, 0.2, 0.5]
    with pytest.raises(RefusedError, match="'2' is no version"):
        tables.chain("arm", "2")
    with pytest.raises(RefusedError, match="no chain 'arn'; its chains are arm; did you mean arm"):
        tables.chain("arn")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("schema = 1", "schema = 2", "chains.toml:1: schema"),
        ("[0.0, 0.0, 1.0, 0.5]", "[0.0, 0.0, 2.0, 0.5]", "chains.toml:3: floor: its rows are no rotation"),
        ("limits = [-90.0, 90.0]", "limits = [90.0, -90.0]", "chains.toml:5: shoulder: limits are a smaller and"),
        ("a = 0.3", "a = nan", "chains.toml:5: shoulder: a, d, alpha and offset are finite"),
        ("alpha", "aplha", "chains.toml:6: links.elbow: there is no key 'aplha'"),
        ("upper = 150.0", "upper = -1.0, lower = 0.0", "chains.toml:8: both: factors are finite, and lower"),
        (
            '"shoulder", "elbow"], c',
            '"shulder", "elbow"], c',
            "chains.toml:10: arm 1.0: there is no link 'shulder'",
        ),
        ('"shoulder", "elbow"], c', '"shoulder"], c', r"chains.toml:10: arm 1.0: .* that it has not: \['elbow'\]"),
        ('"shoulder", "elbow"], c', '"elbow", "elbow"], c', "chains.toml:10: arm 1.0: two of its links have one joint"),
        ("blocked = { elbow", "blocked = { wrist", "chains.toml:11: arm 1.10 has no joint 'wrist'"),
        ('"1.10"', '"last"', 'chains.toml:9: chains.arm: a version is two numbers, such as "2.5"'),
    ],
)
def test_what_is_wrong_is_reported_with_its_line(tmp_path: Path, old: str, new: str, message: str):
    """Errors name the file, the line and the thing."""
    with pytest.raises(RobotModelError, match=message):
        read(tmp_path, old, new)


def test_a_robot_without_tables():
    """A robot without the file says so."""
    with pytest.raises(RobotModelError, match=r"chains\.toml: there is no such file; bench has no tables"):
        robot_chains(load_robot("bench"))
