"""Which code a program's launches ran: one that had no kernel does not hide among those that had."""

import pandas as pd
import pytest

from study.numbers import analysis

WHY = "general: cc took longer than its time limit, 60 s"


@pytest.mark.parametrize(
    ("kernels", "said"),
    [
        (["generated", "generated"], "generated"),
        ([WHY, WHY], WHY),
        ([WHY, "generated", "generated"], f"{WHY}, in 1 of 3 launches"),
        (["generated", WHY], f"{WHY}, in 1 of 2 launches"),
        ([None, None], None),
    ],
)
def test_every_launch_is_asked(kernels, said) -> None:
    frames = pd.DataFrame({"launch": range(len(kernels)), "kernel": kernels})
    assert analysis.kernel_said(frames) == said
    assert analysis.kernel_said(frames.drop(columns="kernel")) is None
