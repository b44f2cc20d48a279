#!/usr/bin/env bash
# Generate a typed client from a service's OpenAPI document into examples/clients/generated/ (not committed).
# Usage: generate_client.sh [URL]
set -euo pipefail

url=${1:-http://127.0.0.1:8000}
here=$(cd "$(dirname "$0")" && pwd)
tool=${OPENAPI_PYTHON_CLIENT:-openapi-python-client}

# a service on this machine is never reached through a proxy
export no_proxy="localhost,127.0.0.1,::1,${no_proxy:-${NO_PROXY:-}}"
mkdir -p "$here/generated"
curl -sSf -o "$here/generated/openapi.json" "$url/openapi.json"
"$tool" generate --path "$here/generated/openapi.json" --meta none --overwrite --output-path "$here/generated/morphid_client"
