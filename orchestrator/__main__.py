"""`python -m orchestrator`: the REST door and the viewer as a process."""

import os
import sys

from orchestrator.bootstrap import PORT, bootstrap
from service_kit.run import run
from service_kit.settings import BadSetting, Settings

if __name__ == "__main__":
    try:
        settings = Settings(os.environ)
        run(bootstrap(settings), settings, PORT)
    except BadSetting as error:
        sys.exit(f"orchestrator: {error}")
