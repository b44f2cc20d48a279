# One image for the API, the worker and the beat; docker-compose.yml says which is which.
# The base by its content, the packages by their hashes: the same image today and next year.
ARG PYTHON_IMAGE=python:3.11.16-slim@sha256:9c900dea9e8fb7e16277c179b555cc72d29a352dbc33cff48ad5a0412fd5bfc7
FROM ${PYTHON_IMAGE} AS build

WORKDIR /srv/morphid
RUN python -m venv .venv
COPY requirements-server.txt ./
RUN .venv/bin/pip install --no-cache-dir --disable-pip-version-check --require-hashes -r requirements-server.txt
COPY pyproject.toml README.md LICENSE ./
COPY app app
COPY morphid morphid
COPY migrations migrations
COPY morphcore morphcore
COPY morphdata morphdata
COPY worker worker
# what builds it is among the packages above: nothing comes in without a hash
RUN .venv/bin/pip install --no-cache-dir --disable-pip-version-check --no-deps --no-build-isolation -e .

FROM ${PYTHON_IMAGE}

RUN useradd --system --uid 10001 --home-dir /var/lib/morphid --create-home morphid \
    && install -d -o morphid -g morphid /var/cache/morphid
COPY --from=build /srv/morphid /srv/morphid
ENV PATH=/srv/morphid/.venv/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CACHE_DIR=/var/cache/morphid \
    MPLCONFIGDIR=/var/cache/morphid \
    MORPHID_DATA_DIR=/var/lib/morphid
USER morphid
WORKDIR /srv/morphid
EXPOSE 8000
CMD ["morphid", "serve"]
