# The checkout with both environments: `docker run IMAGE demo --out /out` and `docker run IMAGE test`, as in the README.
# Here is no graphics card; torch is pip's own unless the build is given another index: docs/farm.md.
FROM python:3.11-slim

# Blender's, as Debian calls them (tools/dev.py: BLENDER_LIBRARIES); unpinned, as Debian keeps no older versions
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends \
        libx11-6 libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libgomp1 \
    && rm -rf /var/lib/apt/lists/*

RUN useradd --create-home karf && mkdir /out && chown karf:karf /out
USER karf
WORKDIR /home/karf/karf

# the environments first: a change of the code leaves them as they are
ARG PIP_EXTRA_INDEX_URL
ENV PIP_NO_CACHE_DIR=1
COPY --chown=karf:karf requirements/ requirements/
COPY --chown=karf:karf tools/dev.py tools/dev.py
RUN python3 tools/dev.py setup

COPY --chown=karf:karf . .

ENTRYPOINT ["python3", "tools/dev.py"]
CMD ["test"]
