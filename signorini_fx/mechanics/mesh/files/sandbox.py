"""A process that gives up what reading a file does not need: other files, other programs, the network.

On Linux two mechanisms of the kernel are combined, without any library.  *seccomp* lets a process call only a few
functions of the kernel: none that starts a program or another process, opens a connection, opens a file for writing,
or changes, moves or removes one.  *Landlock* (Linux 5.13 and later) lets it open only the given files for reading.
Neither can be undone.  Other systems have neither; there is no error then.

This module imports nothing of the package, because it is used before the package is imported.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
import struct
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

_NO_NEW_PRIVILEGES = 38
# Landlock: the numbers of its calls, and rights by the version of its interface that introduced them.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_READ_FILE, _READ_DIRECTORY = 1 << 2, 1 << 3
_RIGHTS = {1: 13, 2: 14, 3: 15, 5: 16}  # interface -> how many rights on files there are
# seccomp: verdicts, and codes of its filter language.
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000
_LOAD, _EQUAL, _ANY_BIT, _RETURN = 0x20, 0x15, 0x45, 0x06
_EACCES, _ENOSYS = 13, 38
# Flags of open(): for writing, or creating or truncating a file, or making one without a name.
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | 0x400000
_THREAD = 0x10000

# What may be called, on each processor: its name for seccomp, the number of seccomp itself, and the numbers of
# read ... that need no further look; then open, openat, clone, tgkill, prlimit64 (None: it does not exist).
_SIMPLE = {
    "x86_64": (
        *(
            0,
            1,
            3,
            4,
            5,
            6,
            7,
            8,
            9,
            10,
            11,
            12,
            13,
            14,
            15,
            17,
            18,
            19,
            20,
            21,
            24,
            25,
            27,
            28,
            32,
            33,
            35,
            39,
            60,
            63,
        ),
        *(72, 73, 74, 77, 79, 89, 96, 97, 98, 99, 100, 102, 104, 107, 108, 110, 131, 137, 138, 186, 201, 202, 204),
        *(217, 218, 219, 228, 229, 230, 231, 262, 267, 269, 273, 292, 309, 318, 324, 332, 334, 439),
    ),
    "aarch64": (
        *(17, 23, 24, 25, 32, 43, 44, 46, 48, 57, 61, 62, 63, 64, 65, 66, 67, 68, 73, 78, 79, 80, 82, 93, 94, 96, 98),
        *(99, 101, 113, 114, 115, 123, 124, 128, 132, 134, 135, 139, 153, 160, 163, 165, 168, 169, 172, 173, 174, 175),
        *(176, 177, 178, 179, 214, 215, 216, 222, 226, 232, 233, 278, 283, 291, 293, 439),
    ),
}
_ARCHITECTURE = {"x86_64": (0xC000003E, 317), "aarch64": (0xC00000B7, 277)}
_EXAMINED = {"x86_64": (2, 257, 56, 234, 302), "aarch64": (None, 56, 220, 131, 261)}


def available() -> tuple[str, ...]:
    """The mechanisms that this system has: ``seccomp``, ``Landlock``."""
    if not sys.platform.startswith("linux"):
        return ()
    libc = ctypes.CDLL(None, use_errno=True)
    mechanisms = []
    processor = _ARCHITECTURE.get(platform.machine())
    refuse = ctypes.c_uint32(_REFUSE)
    if processor and sys.byteorder == "little" and libc.syscall(processor[1], 2, 0, ctypes.byref(refuse)) == 0:
        mechanisms.append("seccomp")
    if libc.syscall(_CREATE_RULESET, None, 0, 1) > 0:
        mechanisms.append("Landlock")
    return tuple(mechanisms)


def confine(readable: Iterable[Path]) -> tuple[str, ...]:
    """Give up everything but computing, reading these files and what is open already; this cannot be undone.

    Python's and the system's libraries may still be read, because some are loaded when they are first used.

    Args:
        readable: files.

    Returns:
        The mechanisms in use, see ``available``.

    Raises:
        OSError: the system has a mechanism, but refuses to use it.
    """
    mechanisms = available()
    if not mechanisms:
        return ()
    libc = ctypes.CDLL(None, use_errno=True)
    _call(libc.prctl, _NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    if "Landlock" in mechanisms:
        _restrict_files(libc, readable)
    if "seccomp" in mechanisms:
        _restrict_calls(libc)
    return mechanisms


def _call(function: ctypes._NamedFuncPointer, *arguments: object) -> int:
    result = int(function(*arguments))
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def _restrict_files(libc: ctypes.CDLL, readable: Iterable[Path]) -> None:
    interface = libc.syscall(_CREATE_RULESET, None, 0, 1)
    rights = (1 << max(count for since, count in _RIGHTS.items() if since <= interface)) - 1
    # Rights on files, on connections (from interface 4), and signals and sockets outside (from 6).
    attributes = struct.pack("QQQ", rights, 3, 3)[: 8 if interface < 4 else 16 if interface < 6 else 24]
    rules = _call(libc.syscall, _CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    libraries = {f"{prefix}/lib{bits}" for prefix in (sys.prefix, sys.base_prefix, "/usr", "") for bits in ("", "64")}
    allowed = [(Path(folder), _READ_FILE | _READ_DIRECTORY) for folder in sorted(libraries)]
    for path, right in [*allowed, *((file, _READ_FILE) for file in readable)]:
        with contextlib.suppress(FileNotFoundError):
            descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
            rule = struct.pack("=Qi", right, descriptor)
            _call(libc.syscall, _ADD_RULE, rules, 1, rule, 0)
            os.close(descriptor)
    _call(libc.syscall, _RESTRICT_SELF, rules, 0)
    os.close(rules)


def _restrict_calls(libc: ctypes.CDLL) -> None:
    machine = platform.machine()
    program = b"".join(struct.pack("HBBI", *line) for line in _filter(machine))
    text = ctypes.create_string_buffer(program, len(program))
    filter_program = struct.pack("HP", len(program) // 8, ctypes.addressof(text))
    _call(libc.syscall, _ARCHITECTURE[machine][1], 1, 1, filter_program)  # a filter, for all threads


def _filter(machine: str) -> Iterator[tuple[int, int, int, int]]:
    """The filter: lines of (code, lines to skip if true, if false, value)."""
    yield _LOAD, 0, 0, 4
    yield _EQUAL, 1, 0, _ARCHITECTURE[machine][0]
    yield _RETURN, 0, 0, _REFUSE | _ENOSYS
    yield _LOAD, 0, 0, 0
    for number in _SIMPLE[machine]:
        yield _EQUAL, 0, 1, number
        yield _RETURN, 0, 0, _ALLOW
    plain, relative, clone, tgkill, prlimit = _EXAMINED[machine]
    # (call, its argument that is looked at, how it is compared, with what, verdict if so, otherwise)
    refused = _REFUSE | _EACCES
    examined = (
        (plain, 1, _ANY_BIT, _WRITING, refused, _ALLOW),
        (relative, 2, _ANY_BIT, _WRITING, refused, _ALLOW),
        (clone, 0, _ANY_BIT, _THREAD, _ALLOW, refused),
        (tgkill, 0, _EQUAL, os.getpid(), _ALLOW, refused),
        (prlimit, 0, _EQUAL, 0, _ALLOW, refused),
    )
    for call, argument, code, value, verdict, otherwise in examined:
        if call is not None:
            yield _EQUAL, 0, 4, call
            yield _LOAD, 0, 0, 16 + 8 * argument
            yield code, 0, 1, value
            yield _RETURN, 0, 0, verdict
            yield _RETURN, 0, 0, otherwise
    # As on an older system: libraries then do without, or take an older call.
    yield _RETURN, 0, 0, _REFUSE | _ENOSYS
