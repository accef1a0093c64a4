"""Rendering back-ends that need no screen: EGL, or OSMesa if EGL is missing.

The back-end must be chosen before OpenGL is loaded, once in a process. So both libraries are tried first, without
OpenGL.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
from functools import cache
from importlib import import_module
from typing import Any, Literal

from rtf.robot.model.engine import mujoco
from rtf.simulator.errors import RenderingError

BackEnd = Literal["egl", "osmesa"]

#: The environment variable that selects a back-end, the same as MuJoCo's.
VARIABLE = "MUJOCO_GL"
_PLATFORM_DEVICE = 0x313F  # EGL_PLATFORM_DEVICE_EXT
_MAX_DEVICES = 8
_HINT = (
    "install the Debian packages libegl1 libegl-mesa0 libgl1-mesa-dri (EGL), or libosmesa6 (OSMesa), "
    "and the Python package mujoco-core[rendering]"
)


@cache
def rendering_back_end() -> BackEnd:
    """Return the first back-end that works on this machine. Raises RenderingError with the reasons and a hint."""
    asked = os.environ.get(VARIABLE, "")
    reasons = []
    for name, obstacle in (("egl", _obstacle_to_egl), ("osmesa", _obstacle_to_osmesa)):
        if asked in {"egl", "osmesa"} and asked != name:
            continue
        reason = obstacle()
        if not reason:
            return "egl" if name == "egl" else "osmesa"
        reasons.append(f"{name}: {reason}")
    raise RenderingError(f"no picture can be made on this machine ({'; '.join(reasons)}); {_HINT}")


def make_context(width: int, height: int) -> Any:
    """Make an OpenGL context without a screen. It belongs to the thread that makes it current."""
    name = rendering_back_end()
    mujoco()
    os.environ.setdefault("PYOPENGL_PLATFORM", name)
    try:
        return import_module(f"mujoco.{name}").GLContext(width, height)
    except (ImportError, RuntimeError, AttributeError) as error:
        raise RenderingError(f"no picture can be made with {name} on this machine ({error}); {_HINT}") from error


def _obstacle_to_egl() -> str:
    """Return why EGL cannot open any device; an empty string if it can."""
    library = _load("EGL")
    if library is None:
        return "no library libEGL"
    library.eglGetProcAddress.restype = ctypes.c_void_p
    query = library.eglGetProcAddress(b"eglQueryDevicesEXT")
    display = library.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query or not display:
        return "libEGL does not support devices without a screen"
    return "" if _opens_a_device(library, query, display) else "libEGL finds no driver"


def _opens_a_device(library: ctypes.CDLL, query: int, display: int) -> bool:
    devices = (ctypes.c_void_p * _MAX_DEVICES)()
    count = ctypes.c_int()
    query_devices = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query)
    get_display = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(display)
    query_devices(_MAX_DEVICES, devices, ctypes.byref(count))
    library.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    opened = (get_display(_PLATFORM_DEVICE, device, None) for device in devices[: count.value])
    return any(handle and library.eglInitialize(handle, None, None) for handle in opened)


def _obstacle_to_osmesa() -> str:
    return "no library libOSMesa" if _load("OSMesa") is None else ""


def _load(name: str) -> ctypes.CDLL | None:
    found = ctypes.util.find_library(name)
    if found is None:
        return None
    try:
        return ctypes.CDLL(found)
    except OSError:
        return None
