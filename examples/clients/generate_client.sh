#!/usr/bin/env bash
# Generate a typed client from a service's OpenAPI document into examples/clients/generated/ (not committed).
# Usage: generate_client.sh [URL]
set -euo pipefail

url=${1:-http://127.0.0.1:8000}
here=$(cd "$(dirname "$0")" && pwd)
tool=${OPENAPI_PYTHON_CLIENT:-openapi-python-client}

mkdir -p "$here/generated"
"$tool" generate --url "$url/openapi.json" --meta none --overwrite --output-path "$here/generated/morphid_client"
