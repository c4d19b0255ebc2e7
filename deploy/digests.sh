#!/usr/bin/env bash
# Prints the images that are not built here with the digests that their registry has now, as lines for deploy/.env; for
# Kubernetes write postgres's into kustomization.yaml (`digest:`), and give the others to `docker build --build-arg`.
# A tag can be replaced by whoever holds its registry, a digest cannot. Needs docker with buildx, and the network.
set -euo pipefail
cd "$(dirname "$0")"

grep -oE "^(PYTHON|DEBIAN|POSTGRES)_IMAGE=[^@]+" .env.example | while IFS="=" read -r name image; do
    digest=$(docker buildx imagetools inspect --format "{{.Manifest.Digest}}" "$image")
    [[ $digest == sha256:* ]] || { echo "digests: no digest of $image: $digest" >&2; exit 1; }
    echo "$name=$image@$digest"
done
