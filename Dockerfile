# The command in a small image: docker build -t roscausal . && docker run --rm -v "$PWD:/data" roscausal discover walk.csv
FROM rust:1.95-bookworm AS builder
WORKDIR /roscausal
COPY . .
RUN packaging/release.sh --dry-run --only deb

FROM debian:bookworm-slim
COPY --from=builder /roscausal/dist/roscausal_*.deb /tmp/
RUN apt-get update && apt-get install -y --no-install-recommends /tmp/roscausal_*.deb && rm -rf /tmp/*.deb /var/lib/apt/lists/*
USER 1000
WORKDIR /data
ENTRYPOINT ["roscausal"]
