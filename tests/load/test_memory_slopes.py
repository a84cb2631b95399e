"""Growth is told from noise, and from neither where the run was too short."""

import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from tests.load.memory_slopes import Memory, Sample, Slope, memory_of, plot, slope, table

SECONDS = 2400


def samples(mb_an_hour: float, noise_mb: float = 0.0, begun_mb: float = 100.0) -> list[Sample]:
    """Forty minutes, read once a second, a delivery every fifteen; each holds 30 MB now and then."""
    chance = random.Random(7)
    found = []
    for second in range(SECONDS):
        busy = 30.0 if second % 15 < 5 else 0.0
        own = begun_mb + mb_an_hour * second / 3600 + busy + abs(chance.gauss(0.0, noise_mb))
        found.append(Sample(second / 3600, second // 15, {"sim": Memory(own, own + 50.0)}))
    return found


@pytest.mark.parametrize(("mb_an_hour", "verdict"), [(0.0, "flat"), (0.5, "flat"), (3.7, "grows"), (-5.0, "flat")])
def test_growth_below_what_requests_hold_for_a_while_is_found(mb_an_hour: float, verdict: str) -> None:
    found = slope(samples(mb_an_hour, noise_mb=0.5), "sim")
    assert found.low <= mb_an_hour <= found.high
    assert found.mb_an_hour == pytest.approx(mb_an_hour, abs=0.2)
    assert found.verdict(1.0) == verdict


def test_where_noise_is_larger_than_what_is_asked_nothing_is_claimed() -> None:
    found = []
    for sample in samples(1.0):
        own, resident = sample.services["sim"]
        level = (0.0, 6.0, 1.0, 5.0, 0.0, 6.0, 2.0, 4.0)[int(sample.hours * 12)]  # another every five minutes
        found.append(sample._replace(services={"sim": Memory(own + level, resident + level)}))
    assert slope(found, "sim").verdict(1.0) == "undecided"


def test_too_few_samples_are_said() -> None:
    with pytest.raises(ValueError, match="5 samples of sim are too few"):
        slope(samples(0.0)[:5], "sim")


def test_memory_is_read_of_a_process_until_it_has_ended() -> None:
    own, resident = memory_of(os.getpid())
    assert 1.0 < own < resident
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)
        with pytest.raises(ProcessLookupError):
            memory_of(ended.pid)
    with pytest.raises(ProcessLookupError):
        memory_of(ended.pid)


def test_the_table_says_what_a_delivery_leaves_behind() -> None:
    read = samples(3.75)
    [head, line, over] = table({"sim": Slope(3.75, 3.5, 4.0, 100.0, 102.5)}, read, 1.0).splitlines()
    assert head.split()[0] == "service"
    assert line.split()[-2:] == ["16.1", "grows"], "KB a delivery, of 159 in forty minutes"
    assert over == "over 159 deliveries in 40 minutes, warm"


def test_each_service_is_drawn_with_its_slope(tmp_path: Path) -> None:
    read = samples(3.0)
    plot(tmp_path / "soak.svg", read, read[800:], {"sim": Slope(3.0, 2.5, 3.5, 100.0, 102.0)})
    assert "sim: +3.00 MB/h (2.50 to 3.50)" in (tmp_path / "soak.svg").read_text()
