"""`python -m services.llm_parser`: the service as a process."""

from service_kit.run import main
from services.llm_parser.bootstrap import bootstrap
from services.llm_parser.settings import LlmParserSettings

if __name__ == "__main__":
    main("llm_parser", LlmParserSettings, bootstrap)
