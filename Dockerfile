# nathlon with what workers, nights and the committee's room need: docker build -t nathlon .
# Python packages are those of the locks, checked by their hashes. To pin the base as well, name its digest:
#   docker build --build-arg BASE=python:3.11-slim-bookworm@sha256:... -t nathlon .
ARG BASE=python:3.11-slim-bookworm

FROM ${BASE} AS build
WORKDIR /source
RUN pip install --no-cache-dir uv==0.13.9 && python -m venv /opt/nathlon
COPY requirements-base.lock requirements.lock ./
RUN uv pip install --no-cache --python /opt/nathlon/bin/python --require-hashes -r requirements-base.lock
COPY . .
RUN uv pip install --no-cache --python /opt/nathlon/bin/python --no-build-isolation \
        --constraint requirements.lock ".[postgres,drive]"

FROM ${BASE}
# A number, so that a cluster can tell that it is not root.
RUN useradd --uid 10001 --create-home --home-dir /home/racing racing \
    && install --directory --owner=10001 --group=10001 /cache
COPY --from=build /opt/nathlon /opt/nathlon
ENV MPLCONFIGDIR=/cache/matplotlib \
    PATH=/opt/nathlon/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    XDG_CACHE_HOME=/cache
WORKDIR /home/racing
USER 10001:10001
ENTRYPOINT ["nathlon"]
CMD ["--help"]
