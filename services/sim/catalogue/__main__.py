"""Draw the contact sheet: `python -m services.sim.catalogue OUT.png`."""

import argparse
from pathlib import Path

import cv2

from services.sim.catalogue.sheet import contact_sheet
from services.sim.render.gl import GlRenderer


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m services.sim.catalogue", description=__doc__)
    parser.add_argument("out", type=Path, help="the picture to write (PNG)")
    out: Path = parser.parse_args().out
    renderer = GlRenderer()
    try:
        sheet = contact_sheet(renderer)
    finally:
        renderer.close()
    if not cv2.imwrite(str(out), cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 9]):
        parser.error(f"cannot write {out}")


if __name__ == "__main__":
    main()
