"""Calls in processes of their own: results in order, errors as they were raised."""

import os
import time
from functools import partial

import pytest

from study.core.cli import CANNOT_RUN, StudyError
from study.pictures import processes


def test_results_come_in_the_order_of_the_calls_from_other_processes(monkeypatch):
    monkeypatch.setattr(processes, "USABLE", [0, 1])

    def slow(number):
        time.sleep(0.2 if number == 0 else 0)
        return number, os.getpid()

    made = processes.in_processes([partial(slow, number) for number in range(4)])
    assert [number for number, _ in made] == [0, 1, 2, 3]
    assert os.getpid() not in {pid for _, pid in made}


@pytest.mark.parametrize("cpus", [[0], [0, 1]])
def test_an_error_keeps_its_words_and_its_status(cpus, monkeypatch):
    monkeypatch.setattr(processes, "USABLE", cpus)

    def bad():
        raise StudyError("file.json: broken", CANNOT_RUN)

    with pytest.raises(StudyError, match=r"^file\.json: broken$") as raised:
        processes.in_processes([lambda: 1, bad])
    assert raised.value.exit_status == CANNOT_RUN
    assert processes.in_processes([]) == []
