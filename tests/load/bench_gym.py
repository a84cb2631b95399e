"""How many steps a second `LogisticsVLN-v0` makes: a move, five views with depth, their decoding.

python -m tests.load.bench_gym [--steps 200] [--sizes 96 224 400]
"""

import argparse
import sys
import time

from logisticsvln.gym.actions import DISCRETE
from logisticsvln.gym.environment import LogisticsVlnEnv

TURN = DISCRETE.index("turn_left")


def measure(size: int, steps: int) -> float:
    """Steps a second, turning on the spot: the pictures change at each, nothing is in the way."""
    env = LogisticsVlnEnv(image_size=size, max_steps=steps + 20)
    env.reset(seed=0, options={"task": "green-flower-pot"})
    for _ in range(10):
        env.step(TURN)
    began = time.perf_counter()
    for _ in range(steps):
        env.step(TURN)
    took_s = time.perf_counter() - began
    env.close()
    return steps / took_s


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.load.bench_gym", description=__doc__)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--sizes", type=int, nargs="+", default=[96, 224, 400])
    chosen = parser.parse_args()
    for size in chosen.sizes:
        sys.stdout.write(f"{size} px: {measure(size, chosen.steps):.0f} steps/s\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
