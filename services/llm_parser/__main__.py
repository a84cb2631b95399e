"""`python -m services.llm_parser`: the service as a process."""

import os

from service_kit.run import run
from service_kit.settings import Settings
from services.llm_parser.bootstrap import DEFAULT_PORT, bootstrap

if __name__ == "__main__":
    settings = Settings(os.environ)
    run(bootstrap(settings), settings, DEFAULT_PORT)
