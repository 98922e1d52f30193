#!/bin/sh
# Corrects one robot program over HTTP with curl: correct.sh URL CELL PROGRAM OUT
#   TRAMMEL_TOKEN=... deploy/http/correct.sh https://line-3.works:9464 cell-7 weld.mod weld_corrected.mod
set -eu
[ $# -eq 4 ] || { echo "usage: correct.sh URL CELL PROGRAM OUT" >&2; exit 2; }
set -- "$1" "$2" "$3" "$4" ${TRAMMEL_TOKEN:+-H "Authorization: Bearer $TRAMMEL_TOKEN"}
url=$1 cell=$2 program=$3 out=$4
shift 4
code=$(curl -sS -o "$out.part" -D "$out.head" -w '%{http_code}' "$@" \
  -H 'Content-Type: application/octet-stream' -H 'Expect:' --data-binary "@$program" \
  "$url/api/v1/cells/$cell/program?name=$(basename "$program")")
if [ "$code" = 200 ]; then
  grep -i '^trammel-' "$out.head" >&2
  rm -f "$out.head"
  mv "$out.part" "$out"
else
  cat "$out.part" >&2
  rm -f "$out.part" "$out.head"
  exit 3
fi
