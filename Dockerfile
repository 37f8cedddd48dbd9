# Gridfall as a service. Build and run (see README, "Docker"):
#   docker build --build-arg GRIDFALL_COMMIT=$(git rev-parse --short=12 HEAD) -t gridfall .
#   docker run --rm -p 127.0.0.1:8080:8080 -v gridfall-data:/data --gpus all gridfall

FROM rust:1.95-bookworm AS build
WORKDIR /build
COPY . .
ARG GRIDFALL_COMMIT=unknown
ENV GRIDFALL_COMMIT=$GRIDFALL_COMMIT
RUN cargo build --release --locked && strip target/release/gridfall

FROM debian:bookworm-slim
# The Vulkan loader, and the libraries that NVIDIA's driver, mounted by --gpus, is linked with. No driver is in the image:
# without a GPU the CPU engine runs. Webhooks with https: need the authorities of certificates.
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        libvulkan1 libegl1 libglvnd0 libgl1 libglx0 libgles2 libxext6 ca-certificates \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 gridfall \
    && install -d -o gridfall /data
COPY --from=build /build/target/release/gridfall /usr/local/bin/gridfall
# `graphics` is what makes the NVIDIA container runtime mount its Vulkan driver.
ENV NVIDIA_VISIBLE_DEVICES=all NVIDIA_DRIVER_CAPABILITIES=compute,graphics,utility
USER gridfall
VOLUME /data
EXPOSE 8080
ENTRYPOINT ["gridfall"]
CMD ["serve", "--listen", "0.0.0.0:8080", "--data-dir", "/data", "--insecure-no-auth"]
