# One file for all services: `service` names the module that runs, `extra` the dependencies it needs,
# `packages` the system packages (the simulator draws with software OpenGL).
ARG base=python:3.11-slim-bookworm

FROM ${base} AS build
ARG extra
ENV UV_NATIVE_TLS=1 UV_LINK_MODE=copy UV_PROJECT_ENVIRONMENT=/opt/venv UV_PYTHON_DOWNLOADS=never UV_NO_CACHE=1 \
    UV_COMPILE_BYTECODE=1
RUN pip install --no-cache-dir --disable-pip-version-check uv==0.13.9
WORKDIR /src
COPY pyproject.toml uv.lock README.md ./
RUN uv sync --quiet --frozen --no-dev --no-install-project --extra ${extra}
COPY contracts contracts
COPY navigation navigation
COPY service_kit service_kit
COPY episode_kit episode_kit
COPY services services
COPY mission mission
COPY orchestrator orchestrator
COPY launcher launcher
COPY evaluation evaluation
COPY logisticsvln logisticsvln
COPY command_line command_line
RUN uv sync --quiet --frozen --no-dev --no-editable --extra ${extra}

FROM ${base}
ARG packages=""
RUN if [ -n "${packages}" ]; then apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends ${packages} \
    && rm -rf /var/lib/apt/lists/*; fi
RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin drone \
    && install -d -o drone -g drone /data /data/runs
COPY --from=build /opt/venv /opt/venv
ARG service
ENV PATH=/opt/venv/bin:${PATH} SERVICE=${service} HOST=0.0.0.0 HOME=/tmp \
    PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1
WORKDIR /data
USER drone
CMD ["sh", "-c", "exec python -m ${SERVICE}"]
