"""The campaign's file: its errors have a place, and its tasks are those that it says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.campaigns.campaign import load_campaign
from rtf.campaigns.designs import make_design
from rtf.campaigns.errors import CampaignError
from rtf.campaigns.tasks import from_json, to_json

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

TEST = '[[tests]]\nname = "trivial.py"\n'
ELBOW = '[[tests]]\nname = "JointSweep"\n[[robots]]\nmodel = "icub"\n'
FAULT = '[[faults]]\nkind = "friction"\ntargets = ["l_elbow"]\n'


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", 1, "tests: a campaign needs one at least"),
        (
            TEST + '[design]\nkind = "claims"\n[[overrides]]\nparameter = "a"\nvalues = [1]\n',
            7,
            "the claims of the tests say",
        ),
        (TEST + 'parameters = { does = "pass" }\n[design]\nkind = "claims"\n', 3, "has a name and nothing else"),
        ("seeds = 0\n" + TEST, 3, "seeds: expected `int` >= 1"),
        ("sedes = 1\n" + TEST, 3, "there is no key 'sedes'"),
        ('[[tests]]\nname = "x"\nsuite = "y"\n', 3, "write the name of a test, or a suite"),
        ('[[tests]]\nname = "NoSuchTest"\n', 4, "NoSuchTest"),
        ('[[tests]]\nsuite = "no.xml"\n', 4, "there is no suite no.xml"),
        ('[[tests]]\nsuite = "any/simulated-joints.xml"\ndefine = { modle = "x" }\n', 5, "has no ${modle}"),
        (TEST + 'faults = ["jam"]\n', 5, "there is no [[faults]] with 'jam'"),
        (TEST + '[[robots]]\nmodel = "nobody"\n', 6, "there is no robot 'nobody'"),
        (TEST + "[[robots]]\nunits = [1]\n", 5, "a simulated robot has a model"),
        (
            TEST + '[[robots]]\nmodel = "icub"\nunits = { first = 3, last = 1 }\n',
            7,
            "the last unit is before the first",
        ),
        (TEST + '[[robots]]\nname = "r"\nports = "icub"\nserver = "here"\n', 8, "write host:port"),
        (TEST + '[[robots]]\nserver = "h:10000"\n', 5, "a real robot needs a name, and ports"),
        (TEST + FAULT, 5, "there is no simulated robot that could have them"),
        (ELBOW + '[[faults]]\nkind = "frction"\n', 8, "there is no fault 'frction'"),
        (ELBOW + '[[faults]]\nkind = "friction"\n', 7, "friction needs targets"),
        (ELBOW + FAULT.replace("l_elbow", "l_elbo"), 9, "no robot has a joint 'l_elbo'; did you mean l_elbow?"),
        (ELBOW + FAULT + "severities = [-5]\n", 10, "makes torque of friction -5 Nm, and it is from 0"),
        (ELBOW + FAULT + "severities = []\n", 10, "there is no value in the list"),
        (ELBOW + FAULT + "severities = { low = 2, high = 1 }\n", 10, "a range goes from low to a greater high"),
        (ELBOW + FAULT + 'severities = { low = 0, high = 1, scale = "log" }\n', 10, "begins above 0"),
        (ELBOW + FAULT + "values = { toque = 1 }\n", 10, "no other parameter 'toque'"),
        (ELBOW + '[[faults]]\nkind = "motor_dead"\ntargets = ["l_elbow"]\nseverities = [1]\n', 10, "has no size"),
        (ELBOW + '[[faults]]\nkind = "friction"\nparts = ["left_am"]\n', 9, "did you mean left_arm?"),
        (TEST + "[backend]\nworkers = -1\n", 6, "expected `int` >= 0"),
        (TEST + '[backend]\naddress = "tcp://x:1"\n', 5, 'are for kind = "dask"'),
        ('files = ["no/*"]\n' + TEST, 3, "nothing matches pattern 1, 'no/*'"),
        (TEST + "[design\n", None, "line 5"),
    ],
)
def test_an_error_has_its_line(write: Callable[[str], Path], text: str, line: int | None, message: str):
    """What is wrong in a file is reported with the file and the line."""
    path = write(text)
    with pytest.raises(CampaignError) as caught:
        load_campaign(path)
    assert message in str(caught.value)
    assert line is None or str(caught.value).startswith(f"{path}:{line}: ")


def test_a_missing_file(tmp_path: Path):
    """A file that is not there is an error of a campaign."""
    with pytest.raises(CampaignError, match="there is no file"):
        load_campaign(tmp_path / "no.toml")


def test_tasks_say_all_that_decides_a_run(write: Callable[[str], Path]):
    """A task has test, robot, unit, seed, fault and overrides; the part of a test follows the faulty joint."""
    text = (
        'healthy = false\nseeds = [7]\n[[tests]]\nname = "PositionControlAccuracy"\nparameters = { cycles = [1, 2] }\n'
    )
    text += '[[robots]]\nmodel = "icub"\nunits = { first = 3, last = 4 }\n'
    text += '[[faults]]\nkind = "encoder_scale"\ntargets = ["l_elbow"]\nseverities = [0.25]\nvalues = { delay = 1 }\n'
    text += '[[overrides]]\nparameter = "speed"\nvalues = [10, 2.5]\n'
    tasks = [*make_design(load_campaign(write(text))).tasks({})]
    assert [(task.unit, task.overrides) for task in tasks] == [
        (unit, (("speed", speed),)) for unit in (3, 4) for speed in ("10", "2.5")
    ]
    (task, *_) = tasks
    assert (task.test, task.model, task.seed) == ("PositionControlAccuracy", "icub", 7)
    assert task.parameters == (("cycles", "(1 2)"), ("part", "left_arm"))
    assert task.fault is not None
    assert task.fault.injection == "encoder_scale l_elbow factor=1.25 delay=1.0"
    assert task.fault.severity == 0.25
    assert from_json(to_json(task)) == task
    assert len({one.key for one in tasks}) == len(tasks)


def test_a_suite_gets_what_it_asks_for(write: Callable[[str], Path]):
    """The variables of a suite for any robot are defined by its task."""
    campaign = load_campaign(write('[[tests]]\nsuite = "any/simulated-joints.xml"\n[[robots]]\nmodel = "bench"\n'))
    (task,) = make_design(campaign).tasks({})
    assert {name for name, _ in task.define} == {"model", "unit", "seed", "parts"}
    assert task.robot == "bench"


def test_files_come_along(write: Callable[[str], Path], tmp_path: Path):
    """Workers get the tests of the file, and what its patterns name."""
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "table.txt").write_text("1")
    campaign = load_campaign(write('files = ["data/*"]\n' + TEST))
    assert set(campaign.files) == {"trivial.py", "data/table.txt"}
