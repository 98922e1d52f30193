#!/usr/bin/env python3
"""Corrects a robot program of one or more files over HTTP, and keeps its receipt. Needs Python alone.

  TRAMMEL_TOKEN=... deploy/http/correct.py https://line-3.works:9464 cell-7 OUT weld.src weld.dat
"""
import base64
import json
import os
import sys
import urllib.error
import urllib.parse
import urllib.request


def ask(url, body):
    headers = {"Content-Type": "application/json"}
    if token := os.environ.get("TRAMMEL_TOKEN"):
        headers["Authorization"] = "Bearer " + token
    request = urllib.request.Request(url, json.dumps(body).encode(), headers)
    try:
        with urllib.request.urlopen(request, timeout=120) as reply:
            return json.load(reply)
    except urllib.error.HTTPError as refused:
        told = json.load(refused).get("error", {})
        sys.exit(f"{refused.code}: {told.get('sentence', told.get('message', 'refused'))}")


def main():
    if len(sys.argv) < 5:
        sys.exit("usage: correct.py URL CELL OUT_FOLDER FILE...")
    url, cell, out, *paths = sys.argv[1:]
    files = []
    for path in paths:
        with open(path, "rb") as file:
            files.append({"name": os.path.basename(path),
                          "base64": base64.b64encode(file.read()).decode()})
    done = ask(f"{url}/api/v1/cells/{urllib.parse.quote(cell, safe='')}/programs", {"files": files})
    os.makedirs(out, exist_ok=True)
    for file in done["files"]:
        with open(os.path.join(out, os.path.basename(file["name"])), "wb") as written:
            written.write(base64.b64decode(file["base64"]))
    with open(os.path.join(out, "receipt.csv"), "w", encoding="utf-8") as receipt:
        receipt.write(done["receipt_csv"])
    print(done["summary"].strip())


if __name__ == "__main__":
    main()
