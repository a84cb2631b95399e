"""`python -m services.depth_assist`: the service as a process."""

from service_kit.run import main
from services.depth_assist.bootstrap import bootstrap
from services.depth_assist.settings import DepthAssistSettings

if __name__ == "__main__":
    main("depth_assist", DepthAssistSettings, bootstrap)
