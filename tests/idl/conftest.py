"""An interface file with all that there is, and a network of this process."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rtf import idl
from rtf.middleware.naming.local import LocalNames
from rtf.middleware.ports.network import Network

if TYPE_CHECKING:
    from pathlib import Path

SHAPES = """
namespace yarp lab.shapes

/** A place on a plane. */
struct Point {
  1: double x = 1.5;
  /** to the left, in m */
  2: double y;
}
struct Shape {
  1: string name = "none";
  2: list<Point> corners;
  3: Color color = Color.GREEN;
  4: Point centre = {"x": 2.0};
  5: map<string, Point> marks;
  6: set<i32> numbers;
  7: list<list<i32>> from = [[1, 2], []];
} (yarp.editor = "true")
enum Color { RED = 1, GREEN, BLUE = 7 }
typedef i32 (yarp.type = "yarp::conf::vocab32_t") word
struct Matrix {} (yarp.name = "yarp::sig::Matrix" yarp.includefile = "yarp/sig/Matrix.h")
const i32 ANSWER = 42

/** Numbers and shapes.
 *
 * For tests. */
service Adder {
  /** Adds two numbers.
   * @return the sum
   */
  i32 add(1: i32 a, 2: i32 b = 3);
  bool is_on();
  Shape moved(1: Shape shape, 2: Point by);
  map<string, i64> counts(1: list<string> names);
  oneway void shout(1: string text);
  void rest();
}
service Calculator extends Adder {
  Matrix transposed(1: Matrix matrix);
  Color next_color(1: Color color);
  word code(1: word code);
  list<Point> line(1: i16 count, 2: float step);
}
"""


@pytest.fixture(scope="session")
def shapes_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file."""
    path = tmp_path_factory.mktemp("idl") / "shapes.thrift"
    path.write_text(SHAPES, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def shapes(shapes_file: Path) -> Any:
    """Its classes."""
    return idl.load(shapes_file)


@pytest.fixture
def network() -> Network:
    """A network whose names are known to this process only."""
    return Network(LocalNames())
