"""A remapper of remote boards: axes of several boards on the network as one board."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from rtf.bottle import Bottle, Property
from rtf.robot import parameters
from rtf.robot.boards.client import make_client
from rtf.robot.device import Device
from rtf.robot.devices.remapper import RemappedBoard, find_axes, read_axis_names

if TYPE_CHECKING:
    from collections.abc import Sequence

_OPTIONS = "REMOTE_CONTROLBOARD_OPTIONS"


class RemoteControlBoardRemapper(RemappedBoard, Device):
    """A board made of axes of remote boards, with a client for each.

    ======================== =====================================================================================
    ``axesNames``            the axes, in the requested order
    ``remoteControlBoards``  the boards that have them, such as ``(/icub/left_arm /icub/torso)``
    ``localPortPrefix``      the prefix of the clients' port names, before the name of their board
    ======================== =====================================================================================

    The group ``REMOTE_CONTROLBOARD_OPTIONS`` is given to every client.
    """

    _opened: ExitStack | None = None

    def open(self, configuration: Property) -> None:
        names = read_axis_names(configuration)
        remotes = parameters.names(configuration, "remoteControlBoards")
        if not remotes:
            raise parameters.wrong(configuration, "remoteControlBoards", "it is a list, such as (/icub/left_arm)")
        prefix = parameters.port_name(configuration, "localPortPrefix")
        options = configuration.find_group(_OPTIONS) or Bottle()
        with ExitStack() as opened:
            boards = self._connect(remotes, prefix, options, opened)
            self.places = find_axes(names, boards, self.name)
            self._opened = opened.pop_all()

    def _connect(self, remotes: Sequence[str], prefix: str, options: Bottle, opened: ExitStack) -> dict[str, Device]:
        """Open a client for each board; ``opened`` closes it."""
        boards: dict[str, Device] = {}
        for remote in remotes:
            configuration = Property.from_bottle(options)
            configuration.put("remote", remote)
            configuration.put("local", f"{prefix}{remote}")
            board = make_client(remote, self.network)
            board.open(configuration)
            opened.callback(board.close)
            boards[remote] = board
        return boards

    def close(self) -> None:
        """Close the clients; the remote boards stay as they are."""
        self.places = ()
        if self._opened is not None:
            self._opened.close()
            self._opened = None
