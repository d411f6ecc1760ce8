"""Faults of memory as the sanitizers tell them: what is said and advised. The texts are of gcc 12."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest

from study.core.registry import ROOT
from study.labs import memory

OVERFLOW = f"""\
=================================================================
==71==ERROR: AddressSanitizer: heap-buffer-overflow on address 0x602 at pc 0x55 bp 0x7f sp 0x7f
WRITE of size 8 at 0x602 thread T0
    #0 0x55d0 in phase_update {ROOT}/phases/mine/render.c:36
    #1 0x55d1 in phase_prepare {ROOT}/phases/mine/render.c:22
    #2 0x55d2 in run common/driver/driver.c:180
    #3 0x7f0a in __libc_start_call_main (/lib/x86_64-linux-gnu/libc.so.6+0x2724)

0x602 is located 0 bytes to the right of 288-byte region [0x5e0,0x602)
allocated by thread T0 here:
    #0 0x7f0b in malloc (/lib/libasan.so.8+0xb8)
    #1 0x55d3 in phase_prepare {ROOT}/phases/mine/render.c:15

SUMMARY: AddressSanitizer: heap-buffer-overflow phases/mine/render.c:36 in phase_update
Shadow bytes around the buggy address:
  0x0c04: fa fa
"""
POISON = OVERFLOW.replace("heap-buffer-overflow", "use-after-poison")
SEGV = """\
AddressSanitizer:DEADLYSIGNAL
==1==ERROR: AddressSanitizer: SEGV on unknown address 0x0 (pc 0x1)
    #0 0x1 in f phases/a/b/c.c:7
"""
UNDEFINED = (
    "phases/mine/sdf.h:88:12: runtime error: index 6 out of bounds for type 'double [6]'\n    #0 0x1 in f\n"
)
LARGE = """\
==1==ERROR: AddressSanitizer: requested allocation size 0x10 exceeds maximum supported size (thread T0)
    #0 0x1 in malloc ../src/asan_malloc_linux.cpp:69
    #1 0x1 in phase_prepare phases/mine/render.c:18
SUMMARY: AddressSanitizer: allocation-size-too-big ../src/asan_malloc_linux.cpp:69 in malloc
"""
GROWN = "==9==AddressSanitizer: hard rss limit exhausted (4096Mb vs 4100Mb)\n"


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        (OVERFLOW, "array", "heap-buffer-overflow, phases/mine/render.c:36"),
        (POISON, "plane", "use-after-poison, phases/mine/render.c:36"),
        (SEGV, "plane", "SEGV .*, phases/a/b/c.c:7"),
        (UNDEFINED, "undefined", "index 6 .*, phases/mine/sdf.h:88"),
        (LARGE, "room", "requested allocation size 0x10"),
        (GROWN, "room", "hard rss limit"),
        ("one\nconnect: no\n", "ends", "mine: status 1: connect: no"),
        ("", "ends", "mine: status 1"),
    ],
)
def test_what_is_said(text: str, kind: str, said: str) -> None:
    fault = memory.fault_of(text, "mine: status 1")
    assert fault.kind == kind and re.match(said, fault.said) and "\n" not in fault.said


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        (SEGV.replace("SEGV", "FPE"), "late", "mine: no end after 9 s, phases/a/b/c.c:7"),
        ("", "late", "mine: no end after 9 s"),
        (UNDEFINED + SEGV.replace("SEGV", "FPE"), "undefined", "index 6 .*, phases/mine/sdf.h:88"),
    ],
)
def test_what_has_not_ended_is_said_to_be_late(text: str, kind: str, said: str) -> None:
    """By the stack at which it was asked; what went wrong before is told first."""
    fault = memory.fault_of(text, "mine: no end after 9 s", late=True)
    assert fault.kind == kind and re.match(said, fault.said)


@pytest.mark.parametrize(("load", "times"), [(0.1, 1), (8.0, 8)])
def test_a_picture_has_more_time_on_a_busy_machine(monkeypatch, load: float, times: float) -> None:
    asked = []
    monkeypatch.delenv("STEPWISE_CHILD_SECONDS", raising=False)
    monkeypatch.setattr(memory.os, "getloadavg", lambda: (load * len(memory.run.USABLE), 0, 0))
    monkeypatch.setattr(
        memory.child, "run", lambda words, **_: asked.append(words) or SimpleNamespace(returncode=0)
    )
    assert memory._run(["build/judge/mine/render"]) is None
    assert [float(word) for word in asked[0] if str(word)[:1].isdigit()] == [memory.SECONDS * times]


def test_the_text_is_short_and_of_this_folder() -> None:
    """Without the bytes of the shadow and the frames of libraries."""
    lines = memory.fault_of(OVERFLOW, "").text.splitlines()
    assert "heap-buffer-overflow" in lines[0] and lines[-1].startswith("SUMMARY")
    assert sum("phases/mine/render.c" in line for line in lines) == 4
    assert not any(str(ROOT) in line or "libasan" in line or "Shadow" in line for line in lines)
