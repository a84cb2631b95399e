"""`python -m orchestrator`: deliveries over REST and the viewer, as a process."""

from orchestrator.bootstrap import bootstrap
from orchestrator.settings import OrchestratorSettings
from service_kit.run import main

if __name__ == "__main__":
    main("orchestrator", OrchestratorSettings, bootstrap)
