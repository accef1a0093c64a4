"""Pictures of the robot's cameras, and the meshes that are in them."""

from __future__ import annotations

import time

import numpy as np
import pytest

from icub import build_icub
from pictures import needs_pictures
from rtf.simulator import meshes, rendering
from rtf.simulator.cameras import Camera
from rtf.simulator.errors import RenderingError
from rtf.simulator.plant import Options, Plant
from rtf.simulator.rendering import rendering_back_end


@pytest.fixture(scope="module")
def robot() -> Plant:
    """A robot in front of the cameras."""
    return build_icub(Options(cameras=True))


def reds(picture) -> np.ndarray:
    """The pixels that are red."""
    red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
    return np.argwhere((red > 60) & (red > 3 * green) & (red > 3 * blue))


def greens(picture) -> np.ndarray:
    """The pixels that are green."""
    red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
    return np.argwhere((green > 40) & (green > 3 * red) & (green > 2 * blue))


@needs_pictures
class TestCameras:
    """Taking pictures."""

    @pytest.mark.parametrize("name", ["eyes_left", "eyes_right", "outside"])
    def test_picture_has_its_size_and_shows_something(self, robot: Plant, name):
        """Height, width, three colours of eight bits; more than one colour in it."""
        with Camera(robot.model, name, 160, 120) as camera:
            picture = camera.render(robot.data())
        assert picture.shape == (120, 160, 3)
        assert picture.dtype == np.uint8
        assert picture.flags.c_contiguous
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 20

    def test_both_eyes_see_the_ball_with_a_disparity(self, robot: Plant):
        """The red ball ahead is right of the middle for the left eye, left of it for the right one, at one height."""
        places = []
        for name in ("eyes_left", "eyes_right"):
            with Camera(robot.model, name, 320, 240) as camera:
                found = reds(camera.render(robot.data()))
            assert len(found) > 500
            places.append(found.mean(axis=0))
        (left_row, left), (right_row, right) = places
        assert abs(left_row - right_row) < 2
        assert right < 160 < left
        assert 30 < left - right < 90

    def test_box_on_the_left_is_on_the_left_and_up_is_up(self, robot: Plant):
        """Pictures are neither mirrored nor upside down."""
        with Camera(robot.model, "eyes_left", 320, 240) as camera:
            picture = camera.render(robot.data())
        ball, box = reds(picture).mean(axis=0), greens(picture).mean(axis=0)
        assert box[1] < ball[1]
        assert box[0] < ball[0]

    def test_ball_moves_in_the_picture_when_the_eyes_move(self, robot: Plant):
        """Looking to the right, things go left; looking up, down."""
        with Camera(robot.model, "eyes_left", 320, 240) as camera:
            data = robot.data()
            before = reds(camera.render(data)).mean(axis=0)
            axes = robot.home_axes.copy()
            for axis, angle in ((4, 5.0), (3, -5.0)):  # version, tilt
                axes[axis] += np.radians(angle)
            data.qpos[:] = robot.pose(axes)
            rendering.mujoco().mj_forward(robot.model, data)
            after = reds(camera.render(data)).mean(axis=0)
        assert after[1] < before[1] - 10
        assert after[0] < before[0] - 10

    def test_outside_view_shows_the_robot(self, robot: Plant):
        """The covers are red and white, and there is a lot of them."""
        with Camera(robot.model, "outside", 320, 240) as camera:
            assert len(reds(camera.render(robot.data()))) > 1000

    def test_same_state_gives_the_same_picture(self, robot: Plant):
        """Two pictures of one state are equal."""
        with Camera(robot.model, "eyes_right", 160, 120) as camera:
            first, second = camera.render(robot.data()), camera.render(robot.data())
        np.testing.assert_array_equal(first, second)

    def test_eyes_are_quick_enough_for_sixty_pictures_a_second(self, robot: Plant):
        """Of the processor, and the best of many counts: other processes use the machine, too."""
        with Camera(robot.model, "eyes_left", 320, 240) as camera:
            data = robot.data()

            def seconds() -> float:
                began = time.thread_time()
                camera.render(data)
                return time.thread_time() - began

            assert any(seconds() < 1 / 60 for _ in range(300))

    def test_unknown_camera_is_named(self, robot: Plant):
        """The error lists the cameras."""
        with pytest.raises(ValueError, match=r"no camera 'nose'.*outside, eyes_left, eyes_right"):
            Camera(robot.model, "nose", 320, 240)

    @pytest.mark.parametrize("size", [(0, 240), (320, -1), (5000, 240), (320, 5000)])
    def test_impossible_sizes_are_refused(self, robot: Plant, size):
        """A picture must fit the buffer of the renderer."""
        with pytest.raises(ValueError, match=r"not within 1280x960"):
            Camera(robot.model, "eyes_left", *size)

    def test_closing_twice_does_nothing(self, robot: Plant):
        """The second call raises no error."""
        camera = Camera(robot.model, "eyes_left", 32, 24)
        camera.close()
        camera.close()


class TestBackEnds:
    """The choice of a back-end of the renderer."""

    def test_error_without_any_names_the_remedy(self, monkeypatch):
        """The error names the packages to install, and why each back-end failed."""
        monkeypatch.setattr(rendering, "_load", lambda name: None)
        monkeypatch.delenv(rendering.VARIABLE, raising=False)
        rendering_back_end.cache_clear()
        with pytest.raises(RenderingError, match=r"no library libEGL.*no library libOSMesa.*libegl1 .*libosmesa6"):
            rendering_back_end()
        rendering_back_end.cache_clear()

    def test_second_way_is_taken_when_the_first_is_missing(self, monkeypatch):
        """OSMesa where EGL has no driver."""
        monkeypatch.setattr(rendering, "_obstacle_to_egl", lambda: "no driver")
        monkeypatch.setattr(rendering, "_obstacle_to_osmesa", lambda: "")
        monkeypatch.delenv(rendering.VARIABLE, raising=False)
        rendering_back_end.cache_clear()
        assert rendering_back_end() == "osmesa"
        rendering_back_end.cache_clear()

    def test_user_may_ask_for_one(self, monkeypatch):
        """The back-end that the variable names is used, or refused with an error."""
        monkeypatch.setattr(rendering, "_obstacle_to_egl", lambda: "")
        monkeypatch.setattr(rendering, "_obstacle_to_osmesa", lambda: "not here")
        monkeypatch.setenv(rendering.VARIABLE, "osmesa")
        rendering_back_end.cache_clear()
        with pytest.raises(RenderingError, match=r"\(osmesa: not here\)"):
            rendering_back_end()
        rendering_back_end.cache_clear()


class TestMeshes:
    """The simplification of meshes."""

    @staticmethod
    def grid(count: int) -> np.ndarray:
        """A flat square of 2 count² faces with edge 1."""
        steps = np.arange(count) / count
        corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]]) / count
        return np.array([np.add(corner, (x, y, 0)) for x in steps for y in steps], dtype=np.float32).reshape(-1, 3, 3)

    def test_fewer_faces_with_the_same_outline(self):
        """Cells of a tenth leave about two hundred of five thousand faces, and the square stays where it was."""
        vertices, faces = meshes.clustered(self.grid(50), 0.1)
        assert 150 < len(faces) < 400
        np.testing.assert_allclose(
            [vertices.min(axis=0)[:2], vertices.max(axis=0)[:2]], [[0.05] * 2, [0.95] * 2], atol=0.06
        )
        assert faces.max() < len(vertices)

    def test_a_fine_grid_changes_nothing_but_merges_corners(self):
        """Cells that hold one corner each keep all faces, and let neighbours share their corners."""
        vertices, faces = meshes.clustered(self.grid(4), 0.01)
        assert len(faces) == 32
        assert len(vertices) == 25

    def test_file_is_read_as_written(self, tmp_path):
        """Corners come back in the file's unit."""
        corners = self.grid(2)
        facets = np.zeros(len(corners), dtype=meshes._FACET)
        facets["corners"] = corners
        path = tmp_path / "square.stl"
        path.write_bytes(bytes(80) + len(corners).to_bytes(4, "little") + facets.tobytes())
        np.testing.assert_array_equal(meshes.read_stl(path), corners)

    @pytest.mark.parametrize("content", [b"", b"solid text", bytes(80) + b"\x02\0\0\0" + bytes(50)])
    def test_broken_file_is_named(self, tmp_path, content):
        """A file whose length does not agree with its header is refused."""
        path = tmp_path / "broken.stl"
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"broken.stl: not a binary STL"):
            meshes.read_stl(path)
