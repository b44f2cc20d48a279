#!/usr/bin/env bash
# Fly the flexible model through a morph with curl alone, in one call that waits for the end; python3 reads and
# writes the JSON. Usage: simulate.sh [URL] [FOLDER]
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

python3 - "$here/.." > "$folder/request.json" <<'PYTHON'
import json, pathlib, sys

examples = pathlib.Path(sys.argv[1])
print(json.dumps({
    "aircraft": json.loads((examples / "aircraft.json").read_text()),
    "flight": json.loads((examples / "flight.json").read_text()),
    "model": {"kind": "flexible"},
    "schedules": {"both": {"kind": "constant_rate", "final_rad": 0.5, "duration_s": 0.6, "start_s": 0.1}},
    "duration_s": 1.0,
}))
PYTHON

read_job() { python3 -c 'import json, sys; job = json.load(sys.stdin); print(job["id"], job["status"])'; }

# the answer comes when the job has ended, or after a minute at the latest
read -r job status < <(call -sSf -H 'Content-Type: application/json' -H 'Prefer: wait=60' \
    --data-binary "@$folder/request.json" "$url/simulate" | read_job)
while [ "$status" = queued ] || [ "$status" = running ]; do
    read -r job status < <(call -sSf -H 'Prefer: wait=60' "$url/jobs/$job" | read_job)
done
echo "job $job $status"
[ "$status" = succeeded ] || { call -sS "$url/jobs/$job"; exit 1; }

call -sSf -o "$folder/result.json" "$url/jobs/$job/result"
call -sSf -o "$folder/flight.csv" "$url/jobs/$job/artifacts/flight.csv"
call -sSf -o "$folder/flight.svg" "$url/jobs/$job/artifacts/flight.svg"

python3 - "$folder/result.json" <<'PYTHON'
import json, sys

flight = json.load(open(sys.argv[1]))
for angle, departure in flight["summary"]["max_abs_rad"].items():
    print(f"{angle:<6} {1e3 * departure:8.3f} mrad at most from its start")
print(f"{flight['cost']['wall_s']:.1f} s for {flight['trajectory']['time_s'][-1]:g} s of flight")
PYTHON
