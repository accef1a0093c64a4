"""The search for files: places, their order, and its report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rtf.bottle import Property
from rtf.resources import PlaceStatus, Policy, ResourceError, ResourceFinder, ResourceNotFoundError, Search

if TYPE_CHECKING:
    from pathlib import Path

FOUND, SHADOWED, MISSING, SKIPPED = PlaceStatus.FOUND, PlaceStatus.SHADOWED, PlaceStatus.MISSING, PlaceStatus.SKIPPED


class World:
    """Current directory, user, administrator and installation, all below one folder."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.cwd = self.folder("cwd")
        self.environment = {
            "YARP_CONFIG_HOME": str(self.folder("config_home")),
            "YARP_DATA_HOME": str(self.folder("data_home")),
            "YARP_CONFIG_DIRS": f"{self.folder('config_1')}:{self.folder('config_2')}",
            "YARP_DATA_DIRS": f"{self.folder('data_1')}:{self.folder('data_2')}",
        }

    def folder(self, name: str) -> Path:
        """Make a folder."""
        path = self.root / name
        path.mkdir(parents=True, exist_ok=True)
        return path

    def file(self, name: str, text: str = "") -> Path:
        """Make a file with its folders."""
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def finder(self, *contexts: str, robot: str | None = None, roots: tuple[Path, ...] = ()) -> ResourceFinder:
        """Return a finder that uses this world only."""
        return ResourceFinder(contexts=contexts, robot=robot, roots=roots, environment=self.environment, cwd=self.cwd)

    def relative(self, search: Search) -> list[str]:
        """Return the places of a search, relative to the world."""
        return [str(place.path.relative_to(self.root)) for place in search.places]


@pytest.fixture(name="world")
def _world(tmp_path: Path) -> World:
    return World(tmp_path)


ROOTS = ["config_home", "data_home", "config_1", "config_2", "data_1", "data_2"]
ORDER = [
    "cwd/x.ini",
    *(f"{root}/robots/default/x.ini" for root in ROOTS),
    *(f"{root}/contexts/icub/x.ini" for root in ["cwd", *ROOTS]),
    *(f"{root}/x.ini" for root in ROOTS),
]


def test_the_order(world: World):
    """The order is current directory, robots, contexts, and the roots themselves, each as in YARP."""
    search = world.finder("icub").search("x.ini")
    assert world.relative(search) == ORDER
    assert search.path is None
    assert {place.status for place in search.places} == {MISSING}


@pytest.mark.parametrize("first", range(len(ORDER)))
def test_the_first_existing_place_wins(world: World, first: int):
    """The first existing file is found, and later ones are reported as shadowed."""
    for name in ORDER[first:]:
        world.file(name)
    search = world.finder("icub").search("x.ini")
    assert search.path == world.root / ORDER[first]
    expected = [MISSING] * first + [FOUND] + [SHADOWED] * (len(ORDER) - first - 1)
    assert [place.status for place in search.places] == expected


def test_all_of_them(world: World):
    """The policy ALL finds every file, in the same order."""
    for name in (ORDER[3], ORDER[0], ORDER[-1]):
        world.file(name)
    search = world.finder("icub").search("x.ini", policy=Policy.ALL)
    assert [str(path.relative_to(world.root)) for path in search.paths] == [ORDER[0], ORDER[3], ORDER[-1]]


def test_several_contexts(world: World):
    """Contexts are tried in order, each in all roots."""
    world.file("config_home/contexts/second/x.ini")
    winner = world.file("data_2/contexts/first/x.ini")
    assert world.finder("first", "second").find("x.ini") == winner


def test_robot_names(world: World):
    """The robot is that of the program, or of YARP_ROBOT_NAME."""
    one, other = world.file("data_1/robots/iCubGenova01/x.ini"), world.file("data_1/robots/purple/x.ini")
    assert world.finder(robot="purple").find("x.ini") == other
    world.environment["YARP_ROBOT_NAME"] = "iCubGenova01"
    assert world.finder().find("x.ini") == one
    assert world.finder(robot="purple").find("x.ini") == other


def test_resource_types(world: World):
    """A resource type is a folder below every place."""
    winner = world.file("data_home/modules/x.ini")
    world.file("data_home/x.ini")
    search = world.finder().search("x.ini", resource_type="modules")
    assert search.path == winner
    assert world.relative(search)[0] == "cwd/modules/x.ini"


def test_paths_and_directories(world: World):
    """A name may have folders, or be a directory; an absolute name is its only place."""
    file = world.file("data_1/contexts/icubSim/x.ini")
    finder = world.finder()
    assert finder.find("contexts/icubSim/x.ini") == file
    assert finder.search("contexts/icubSim", directory=True).path == file.parent
    assert finder.search("contexts/icubSim/x.ini", directory=True).path is None
    search = finder.search(str(file))
    assert search.path == file
    assert len(search.places) == 1


def test_further_roots(world: World):
    """A program's own roots come last."""
    suite = world.folder("suite")
    file = world.file("suite/contexts/icubSim/x.ini")
    finder = world.finder("icubSim", roots=(suite,))
    assert finder.find("x.ini") == file
    assert world.relative(finder.search("x.ini"))[-1] == "suite/x.ini"


def test_path_d(world: World):
    """Files in a path.d folder add directories to the search."""
    world.file("data_1/config/path.d/icub.ini", f'[search icub]\npath {world.root}/icub "{world.root}/more"\n')
    file = world.file("icub/contexts/icub/x.ini")
    assert world.finder("icub").find("x.ini") == file
    other = world.file("more/y.ini")
    search = world.finder().search("y.ini")
    assert search.path == other
    assert "path.d, icub" in str(search.places[-1])


def test_an_import_in_path_d_is_ignored_and_reported(world: World):
    """A path.d file says where to search, so it cannot import a file that would have to be searched for."""
    world.file("data_1/config/path.d/bad.ini", "[import context file.ini]")
    search = world.finder().search("x.ini")
    assert search.places[-1].status is SKIPPED
    assert "cannot import" in search.places[-1].note


def test_a_broken_path_d_is_ignored_and_reported(world: World):
    """A damaged path.d file is skipped, with a note in the search."""
    world.file("data_1/config/path.d/bad.ini", "[include a b c d]")
    search = world.finder().search("x.ini")
    assert search.places[-1].status is SKIPPED
    assert "bad.ini:1" in search.places[-1].note


def test_default_directories():
    """The default directories are those of freedesktop's variables, else below the home directory."""
    places = ResourceFinder(environment={"HOME": "/h"}, cwd="/c").search("x").places
    assert [str(place.path) for place in places[-5:]] == [
        "/h/.config/yarp/x",
        "/h/.local/share/yarp/x",
        "/etc/xdg/yarp/x",
        "/usr/local/share/yarp/x",
        "/usr/share/yarp/x",
    ]
    environment = {"XDG_CONFIG_HOME": "/a", "XDG_DATA_HOME": "/b", "XDG_CONFIG_DIRS": "/c:/d", "XDG_DATA_DIRS": "/e"}
    places = ResourceFinder(environment=environment, cwd="/c").search("x").places
    assert [str(place.path) for place in places[-5:]] == [
        "/a/yarp/x",
        "/b/yarp/x",
        "/c/yarp/x",
        "/d/yarp/x",
        "/e/yarp/x",
    ]
    assert len(ResourceFinder(environment={}, cwd="/c").search("x").places) == 7


def test_configuring(world: World):
    """The file is found in the context of the command line, whose options replace its keys."""
    world.file("data_home/contexts/icub/main.ini", "robot ${robotname}\njoints 5\n[G]\nx 1\ny 2")
    finder = world.finder()
    words = ["--context", "icub", "--from", "main.ini", "--joints", "6", "--G::x", "7"]
    read = finder.configure(words, default_context="other", variables=Property({"robotname": "icubSim"}))
    assert finder.properties is read.properties
    assert read.properties == Property.parse(
        "(robot icubSim) (joints 6) (G (x 7) (y 2)) (context icub) (from main.ini)"
    )
    assert finder.contexts == ["icub"]
    assert not finder.near_main


def test_defaults(world: World):
    """Default context and default file apply without options; the default file may be missing."""
    finder = world.finder()
    assert finder.configure(["--a", "1"], default_context="icub", default_file="config.ini").properties == Property(
        {"a": 1}
    )
    world.file("data_home/contexts/icub/config.ini", "b 2")
    read = finder.configure(["--a", "1"], default_context="icub", default_file="config.ini")
    assert read.properties == Property({"a": 1, "b": 2})


def test_a_file_that_was_asked_for_must_exist(world: World):
    """A requested file that is missing is an error with all places."""
    with pytest.raises(ResourceNotFoundError, match="current directory") as caught:
        world.finder().configure(["--from", "none.ini"])
    assert isinstance(caught.value, ResourceError)
    assert str(world.root / "data_2" / "none.ini") in str(caught.value)


def test_near_main_mode(world: World):
    """If the main file is in the current directory, other files are searched beside it, without contexts."""
    world.file("cwd/main.ini", "a 1")
    world.file("data_home/contexts/icub/x.ini")
    finder = world.finder("icub")
    finder.configure(["--from", "main.ini"])
    assert finder.near_main
    search = finder.search("x.ini")
    assert search.path is None
    skipped = [place for place in search.places if place.status is SKIPPED]
    assert len(skipped) == 7
    assert {place.note for place in skipped} == {"the main configuration file was in the current directory"}


def test_the_main_directory_counts_only_in_near_main_mode(world: World):
    """A main file elsewhere does not add its folder, and the search says so."""
    world.file("data_home/sub/main.ini", "a 1")
    world.file("data_home/sub/x.ini")
    finder = world.finder()
    finder.configure(["--from", "sub/main.ini"])
    place = finder.search("x.ini").places[1]
    assert (place.status, place.rule) == (SKIPPED, "beside the main configuration file")
    world.file("cwd/near/main.ini")
    near = world.file("cwd/near/x.ini")
    finder.configure(["--from", "near/main.ini"])
    assert finder.find("x.ini") == near


def test_files_by_key(world: World):
    """A file can be found by a key of the configuration."""
    file = world.file("cwd/model.urdf")
    finder = world.finder()
    finder.configure(["--model", "model.urdf"])
    assert finder.find_file("model") == file
    assert finder.find_file("model.urdf") == file
    with pytest.raises(ResourceNotFoundError):
        finder.find_file("none")


def test_rendering(world: World):
    """The lines of a search have the result, and each place with status and rule."""
    world.file("cwd/x.ini")
    world.file("data_home/x.ini")
    lines = world.finder().search("x.ini").lines()
    assert lines[0] == f"x.ini: {world.cwd}/x.ini"
    assert lines[1] == f"  found    {world.cwd}/x.ini  (current directory)"
    assert lines[9] == f"  shadowed {world.root}/data_home/x.ini  (YARP_DATA_HOME)"
    assert len(lines) == 14
    assert world.finder().search("none").lines()[0] == "none: not found"


@pytest.mark.parametrize("name", ["", "a\0b", "x" * 5000, "../x.ini", "\ud800"])
def test_odd_names(world: World, name: str):
    """No name raises an error."""
    assert isinstance(world.finder().search(name), Search)
