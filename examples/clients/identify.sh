#!/usr/bin/env bash
# Identify a model with curl alone; python3 reads and writes the JSON.
# Usage: identify.sh [URL] [FOLDER]
set -euo pipefail

url=${1:-http://127.0.0.1:8000}
folder=${2:-client-output}
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$folder"
# a service on this machine is never reached through a proxy
export no_proxy="localhost,127.0.0.1,::1,${no_proxy:-${NO_PROXY:-}}"

# a service that demands keys gets the one in MORPHID_API_KEY; by a file, for a process list shows arguments
call() {
    if [ -n "${MORPHID_API_KEY:-}" ]; then
        curl -H @<(echo "Authorization: Bearer $MORPHID_API_KEY") "$@"
    else
        curl "$@"
    fi
}

field() { python3 -c 'import json, sys; print(json.load(sys.stdin)[sys.argv[1]])' "$1"; }

# upload two flights, then name them in the request
slow=$(call -sSf -F "file=@$here/../train_rate_0.5.csv" "$url/trajectories" | field id)
fast=$(call -sSf -F "file=@$here/../train_rate_0.8.csv" "$url/trajectories" | field id)

python3 - "$here/.." "$slow" "$fast" > "$folder/request.json" <<'PYTHON'
import json, os, pathlib, sys

examples, slow, fast = pathlib.Path(sys.argv[1]), *sys.argv[2:]
print(json.dumps({
    "aircraft": json.loads((examples / "aircraft.json").read_text()),
    "flight": json.loads((examples / "flight.json").read_text()),
    "samples": [{"name": "slow", "role": "train", "trajectory_id": slow},
                {"name": "fast", "role": "train", "trajectory_id": fast}],
    "model": {"links_per_wing": 3},
    "search": json.loads(os.environ.get("MORPHID_SEARCH", "{}")),
}))
PYTHON

# the same key posts the same job only once, however often the line is repeated
job=$(call -sSf -H 'Content-Type: application/json' -H "Idempotency-Key: $slow-$fast" \
    --data-binary "@$folder/request.json" "$url/identify" | field id)
echo "job $job"

while :; do
    status=$(call -sSf "$url/jobs/$job" | field status)
    case $status in
        succeeded) break ;;
        failed | cancelled | expired) echo "$status"; call -sS "$url/jobs/$job"; exit 1 ;;
    esac
    sleep 0.5
done

call -sSf -o "$folder/result.json" "$url/jobs/$job/result"
call -sSf "$url/jobs/$job/artifacts" > "$folder/artifacts.json"
call -sSf -o "$folder/convergence.svg" "$url/jobs/$job/artifacts/convergence.svg"

python3 - "$folder/result.json" <<'PYTHON'
import json, sys

for row in json.load(open(sys.argv[1]))["fit"]:
    print(f"{row['sample']:<12} J rigid {row['J_rigid']:.3g}  J identified {row['J_identified']:.3g} rad^2")
PYTHON
