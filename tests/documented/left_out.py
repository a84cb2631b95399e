"""The lines of the documents that no page of commands runs, and why."""

LEFT_OUT = (
    (r"docker |ORCHESTRATOR_TOKEN_FILE=\S+ docker ", "needs Docker; tests/test_deployment.py reads the compose file"),
    (r"kubectl ", "needs a cluster; tests/test_deployment.py validates the manifests"),
    (r"pip install ", "fetches packages; `make setup` installs the same extras"),
    (r"\./CarlaUE4.sh", "CARLA's own program, which is not shipped"),
    (r"CARLA_SCENES=|\S+ -m tests\.carla_double|\S+ serve --vehicle carla", "`make test-carla` runs them"),
    (r"\S*logisticsvln serve --vehicle mavlink", "PX4's image; tests/services/mavlink_vehicle flies the stand-in"),
    (r"make (setup|test|check|docs|help|configuration|expert|train|demo|load)", "all of something; `make -n` reads it"),
    (r"\.venv/bin/uv sync", "changes the environment that the tests run in; `make test-export` does it"),
    (r"\.venv/bin/python -m training ", "hours, and PyTorch; `make test-train` runs each step on little"),
    (r"logisticsvln (worker|bench .*) --database ", "tests/evaluation/bench/test_episode_queue.py runs both"),
    (r"REDIS_URL=redis://cache", "a host of somebody's; tests/services/vlm_gateway runs with a Redis of its own"),
    (r"GATEWAY_CONFIG=gateway.toml \S+ doctor --calibrate", "a model that sees; tests/services/vlm_gateway has one"),
    (r"\S*python -m tests\.load\.(gateway_)?soak ", "an hour: what grows shows in no less"),
    (r"\S*logisticsvln doctor", "ends by what is amiss with a machine, whose ports may be taken; test_doctor.py"),
    (r"logisticsvln submit ", "wants all 300 flights; tests/evaluation/submission has a whole run"),
    (r"(CACHE_PATH=\S+ )?\S*logisticsvln recording ", "wants answers of a model; tests/services/vlm_gateway"),
)
"""Of each: how such a line begins, and who runs the same, or why nobody can."""
PAGES = {"docs/vehicles.md": "tests/system/test_vehicles_page.py runs them in the default suite"}
"""Documents all of whose commands another test runs."""
