# One image for web, worker and the maintainers' commands; docker-compose.yml says which does what.

FROM python:3.11.15-slim-trixie AS environment
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1
RUN python -m venv /opt/tsttc
WORKDIR /build
COPY requirements.lock ./
RUN /opt/tsttc/bin/pip install --quiet --require-hashes -r requirements.lock

FROM python:3.11.15-slim-trixie
ENV PATH=/opt/tsttc/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    OPENBLAS_NUM_THREADS=1 \
    # Celery's warm shutdown on `docker stop`: finish what is in hand, then give the rest back.
    REMAP_SIGTERM=SIGQUIT \
    DJANGO_SETTINGS_MODULE=leaderboard.settings \
    TSTTC_DATA_DIR=/var/lib/tsttc \
    TSTTC_STATIC_ROOT=/srv/tsttc/staticfiles

# For `backup` and `restore`. Debian 13 has version 17, which has to be the database's in docker-compose.yml, or a later one.
RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends postgresql-client \
    && rm -rf /var/lib/apt/lists/*

# Volumes take over the owner of the directory that they are first mounted on.
RUN groupadd --gid 10001 tsttc \
    && useradd --uid 10001 --gid tsttc --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin tsttc \
    && install -d -o tsttc -g tsttc -m 0750 /var/lib/tsttc /var/lib/tsttc/files \
    && install -d -o tsttc -g tsttc -m 0700 /var/lib/tsttc/ground-truth /var/lib/tsttc/bags /var/lib/tsttc/certificates \
        /var/lib/tsttc/buffers

COPY --from=environment /opt/tsttc /opt/tsttc
WORKDIR /srv/tsttc
COPY . .
# Static files and the wheel for visitors are part of the image. Neither needs a service, only settings that load.
RUN TSTTC_PROFILE=embedded TSTTC_DATA_DIR=/tmp/collect python manage.py collectstatic --no-input --verbosity 0 \
    && TSTTC_PROFILE=embedded TSTTC_DATA_DIR=/tmp/collect python manage.py build_wheel \
    && rm -rf /tmp/collect \
    && python -m compileall -q evaluator leaderboard tsttc_baselines

USER tsttc
EXPOSE 8000
CMD ["gunicorn", "--config", "deploy/gunicorn.conf.py", "leaderboard.wsgi:application"]
