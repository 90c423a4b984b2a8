# The API and the worker are the same image with another command.
FROM python:3.13-slim AS environment
WORKDIR /reebase
# Everything comes as wheels; libseccomp lets the worker forbid the network to its children.
RUN apt-get update \
 && apt-get install --yes --no-install-recommends libseccomp2 \
 && rm -rf /var/lib/apt/lists/*
COPY requirements.lock .
RUN python -m pip install --no-cache-dir --no-deps --require-hashes -r requirements.lock

FROM environment
COPY reebase reebase
COPY store store
COPY service service
COPY worker worker
COPY migrations migrations
COPY pyproject.toml README.md LICENSE ./
ENV PYTHONPATH=/reebase PYTHONUNBUFFERED=1 OPENBLAS_NUM_THREADS=1 REEBASE_HOME=/var/lib/reebase
RUN useradd --system --home-dir /var/lib/reebase --create-home reebase \
 && chown --recursive reebase /reebase
USER reebase
# The kernels are compiled into the image, so that a container answers as soon as it starts. By the user that runs them:
# numba passes over a cache that it could not write to.
RUN python -m reebase.warm
VOLUME /var/lib/reebase
EXPOSE 8000
ENTRYPOINT ["python", "-m", "service"]
CMD ["serve", "--host", "0.0.0.0"]
