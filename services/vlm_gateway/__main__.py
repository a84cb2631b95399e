"""`python -m services.vlm_gateway`"""

import os
import sys

from service_kit.run import run
from service_kit.settings import BadSetting, Settings
from services.vlm_gateway.bootstrap import DEFAULT_PORT, build

if __name__ == "__main__":
    settings = Settings(os.environ)
    try:
        app = build(settings)
    except BadSetting as error:
        sys.exit(f"vlm_gateway can't start: {error}")
    run(app, settings, DEFAULT_PORT)
