# One image for the API, the worker and the beat; docker-compose.yml says which is which.
FROM python:3.11-slim AS build

WORKDIR /srv/morphid
RUN python -m venv .venv
COPY constraints.txt pyproject.toml README.md LICENSE ./
RUN .venv/bin/pip install --no-cache-dir --disable-pip-version-check -c constraints.txt uv
COPY app app
COPY cli cli
COPY migrations migrations
COPY morphcore morphcore
COPY samplefiles samplefiles
COPY worker worker
RUN .venv/bin/uv pip install --no-cache --python .venv/bin/python -c constraints.txt -e '.[server]'

FROM python:3.11-slim

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
CMD ["morphid", "serve", "--data-dir", "/var/lib/morphid"]
