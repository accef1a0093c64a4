"""Locks, conditions, events and attributes at which a controlled schedule of threads may turn; see ``schedules``."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import TracebackType

    from schedules import Control, Key, Ready


class Lock:
    """See threading."""

    def __init__(self, control: Control) -> None:
        self._control = control
        self._key = control.new_key()
        self._held = False

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """See threading."""
        if not blocking:
            self._control.pause("take a lock if it is free", uses=self._key)
            if self._held:
                return False
        limit = None if timeout < 0 else timeout
        if not self._control.pause("take a lock", lambda: not self._held, limit, uses=self._key):
            return False
        self._held = True
        return True

    def release(self) -> None:
        """See threading."""
        if not self._held:
            raise RuntimeError("release unlocked lock")
        self._held = False

    def locked(self) -> bool:
        """See threading."""
        return self._held

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


class RLock(Lock):
    """See threading."""

    def __init__(self, control: Control) -> None:
        super().__init__(control)
        self._owner: object = None
        self._depth = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """See threading."""
        me = self._control.current_thread()
        if self._owner is not me and not super().acquire(blocking, timeout):
            return False
        self._owner = me
        self._depth += 1
        return True

    def release(self) -> None:
        """See threading."""
        self._depth -= 1
        if not self._depth:
            self._owner = None
            super().release()


class Condition:
    """See threading, whose steps it takes: also there a wait that ran out may still be notified, for a moment."""

    def __init__(self, control: Control, lock: Lock) -> None:
        self._control = control
        self._key = control.new_key()
        self._lock = lock
        self._waiters: deque[Lock] = deque()

    def __enter__(self) -> bool:
        return self._lock.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        """See threading. The lock must not be held more than once."""
        waiter = Lock(self._control)
        waiter._held = True
        self._waiters.append(waiter)
        self._lock.release()
        notified = self._control.pause("be notified", lambda: not waiter._held, timeout)
        try:
            if not notified:
                self._control.pause("be notified no more", uses=self._key)
                if waiter in self._waiters:
                    self._waiters.remove(waiter)
        finally:
            self._lock.acquire()
        return notified

    def wait_for(self, predicate: Ready, timeout: float | None = None) -> bool:
        """See threading."""
        end = None if timeout is None else self._control.monotonic() + timeout
        while not (result := predicate()):
            left = None if end is None else end - self._control.monotonic()
            if left is not None and left <= 0:
                break
            self.wait(left)
        return result

    def notify(self, count: int = 1) -> None:
        """See threading."""
        self._control.pause("notify", uses=self._key)
        for waiter in [*self._waiters][:count]:
            waiter.release()
            self._waiters.remove(waiter)

    def notify_all(self) -> None:
        """See threading."""
        self.notify(len(self._waiters))


class Event:
    """See threading."""

    def __init__(self, control: Control) -> None:
        self._control = control
        self._key = control.new_key()
        self._set = False

    def is_set(self) -> bool:
        """See threading."""
        self._control.pause("look at an event", uses=self._key, changes=False)
        return self._set

    def set(self) -> None:
        """See threading."""
        self._control.pause("set an event", uses=self._key)
        self._set = True

    def clear(self) -> None:
        """See threading."""
        self._control.pause("clear an event", uses=self._key)
        self._set = False

    def wait(self, timeout: float | None = None) -> bool:
        """See threading."""
        return self._control.pause("wait for an event", lambda: self._set, timeout, uses=self._key, changes=False)


class Shared:
    """An attribute that threads use without a lock: others may come in before each use."""

    def __init__(self, control: Control, name: str) -> None:
        self._control = control
        self._name = name

    def __get__(self, owner: object | None, kind: type) -> Any:
        if owner is None:
            return self
        self._control.pause(f"read {self._name}", uses=self._key_of(owner), changes=False)
        return vars(owner)[self._name]

    def __set__(self, owner: object, value: object) -> None:
        self._control.pause(f"write {self._name}", uses=self._key_of(owner))
        vars(owner)[self._name] = value

    def _key_of(self, owner: object) -> Key:
        kept = f"key of {self._name}"
        if kept not in vars(owner):
            vars(owner)[kept] = self._control.new_key()
        return vars(owner)[kept]
