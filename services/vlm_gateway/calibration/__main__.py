"""`python -m services.vlm_gateway.calibration MODEL --gateway URL`: the calibration as a command.

`GATEWAY_TOKEN` or `GATEWAY_TOKEN_FILE` is the key for the gateway. Ends with 0 where the convention is sure or likely,
with 1 where it is not or the model can't be asked, with 2 for a wrong input.
"""

import argparse
import asyncio
import json
import sys
from collections.abc import Mapping, Sequence

from service_kit.client import CallError, Refused, ServiceClient
from service_kit.connections import Connections
from service_kit.settings import BadSetting, process_environment
from services.vlm_gateway.calibration.ask import Calibration, advice, calibrate, in_words
from services.vlm_gateway.calibration.fit import Convention

TIMEOUT_S = 600.0
MAX_ROUNDS = 20


def main(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """The exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m services.vlm_gateway.calibration", description="Find out how a vision model writes boxes."
    )
    parser.add_argument("model", help="an alias of the gateway")
    parser.add_argument("--gateway", required=True, help="the gateway's address")
    parser.add_argument("--rounds", type=int, choices=range(1, MAX_ROUNDS + 1), metavar="N", default=3)
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    chosen = parser.parse_args(arguments)
    if not chosen.json:
        pictures = "one picture" if chosen.rounds == 1 else f"{chosen.rounds} pictures"
        sys.stdout.write(f"showing {chosen.model} {pictures} of six shapes\n")
    try:
        token = Connections.read(environment).tokens.vlm_gateway
        found = asyncio.run(_calibrate(chosen.model, chosen.gateway, chosen.rounds, token))
    except BadSetting as error:
        return _failed(str(error), 2)
    except Refused as error:
        return _failed(f"the gateway refuses {chosen.model!r}: {error.reason}", 2 if error.status in (404, 422) else 1)
    except CallError as error:
        return _failed(str(error), 1)
    good = found.certainty in ("sure", "likely")
    told = json.dumps({"ok": good, **found.model_dump()}) if chosen.json else in_lines(found)
    sys.stdout.write(told + "\n")
    return 0 if good else 1


async def _calibrate(model: str, gateway: str, rounds: int, token: str | None) -> Calibration:
    async with ServiceClient("vlm_gateway", gateway, timeout_s=TIMEOUT_S, token=token) as client:
        return await calibrate(client, model, rounds)


def in_lines(found: Calibration) -> str:
    """For a person: what was found, how sure that is, and what to put into the configuration."""
    if found.boxes is not None and found.box_order is not None and found.full is not None:
        best = in_words(Convention(found.boxes, found.box_order, found.full, found.image_factor))
    else:
        best = "none"
    rows = (
        ("Boxes", best),
        ("Certainty", found.certainty),
        ("Overlap", f"{found.overlap:.2f} of 1 on average; next best {found.rival_overlap:.2f} ({found.rival})"),
        ("Shapes", f"{found.shapes_told} of {found.shapes_shown} told"),
    )
    return "\n".join([*(f"{name:<10} {text}" for name, text in rows), *advice(found)])


def _failed(message: str, status: int) -> int:
    sys.stderr.write(f"calibration: {' '.join(message.split())}\n")
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], process_environment()))
