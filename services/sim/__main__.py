"""`python -m services.sim`: the service as a process."""

import os
import sys

from service_kit.run import run
from service_kit.settings import BadSetting, Settings
from services.sim.bootstrap import DEFAULT_PORT, bootstrap
from services.sim.render.gl import NoGlContext


def main() -> None:
    settings = Settings(os.environ)
    try:
        app = bootstrap(settings)
    except (BadSetting, NoGlContext) as error:
        sys.exit(f"sim can't start: {error}")
    run(app, settings, DEFAULT_PORT)


if __name__ == "__main__":
    main()
