#!/usr/bin/env python3
"""A program of somebody else asks a service over HTTPS: Python's own library and curl, nothing of ours.

  outside_client.py TASK SETTINGS.json

SETTINGS has `url`, `ca` (PEM), `tokens` (by role), `trammel` (the command line with its options for the
service), `batches` (two CSV files), `programs` (folders of programs, one a dialect), `folder` (to write).
It prints what is not as it should be, and ends with 1 then.
"""
import base64
import http.client
import json
import os
import ssl
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request

FAILED = []
JSON, BYTES, CSV = "application/json", "application/octet-stream", "text/csv"
HOME = {"joints_deg": [5, 10, 15, 20, 25, 30]}
RAPID = (b"MODULE m ! \xe4\r\n CONST jointtarget jA:=[[5,10,15,20,25,30],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n"
         b" PROC main()\r\n  MoveAbsJ jA,v100,fine,spindle;\r\n ENDPROC\r\nENDMODULE\r\n")
# Values of the tools and frames that FANUC's and Yaskawa's samples leave to the controller.
FRAMES = ("name,x_mm,y_mm,z_mm,qw,qx,qy,qz,may_be_unused\n"
          "%s[1],100,0,150,0.923879532511287,0,-0.382683432365090,0,yes\n"
          "%s[1],1800,-250,800,1,0,0,0,yes\n%s[2],1795,-240,810,1,0,0,0,yes\n")


def expect(what, good, told=""):
    if not good:
        FAILED.append(what)
        print(f"FAILED: {what}: {str(told)[:1500]}")


class Service:
    def __init__(self, settings):
        self.url = settings["url"]
        self.tokens = settings["tokens"]
        self.ca = settings["ca"]
        self.context = ssl.create_default_context(cafile=self.ca)

    def ask(self, path, body=None, role="engineer", kind=JSON, headers=None, method=None):
        """Code, bytes and headers of the answer."""
        if isinstance(body, (dict, list)):
            body = json.dumps(body).encode()
        sent = dict(headers or {})
        if body is not None:
            sent["Content-Type"] = kind
        if role:
            sent["Authorization"] = "Bearer " + self.tokens.get(role, role)
        request = urllib.request.Request(self.url + path, body, sent, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120, context=self.context) as reply:
                return reply.status, reply.read(), reply.headers
        except urllib.error.HTTPError as refused:
            return refused.code, refused.read(), refused.headers

    def good(self, path, body=None, **more):
        code, told, _ = self.ask(path, body, **more)
        expect(path, code == 200, told)
        return json.loads(told) if code == 200 else {}

    def curl(self, path, *options, role="engineer"):
        """Code and bytes."""
        done = subprocess.run(
            ["curl", "-sS", "--cacert", self.ca, "-H", "Authorization: Bearer " + self.tokens[role],
             "-w", "\n%{http_code}", *options, self.url + path], capture_output=True, check=False)
        expect("curl " + path, done.returncode == 0, done.stderr)
        told, _, code = done.stdout.rpartition(b"\n")
        return int(code or 0), told

    def ended(self, job):
        """The job, once it has ended."""
        until = time.monotonic() + 120
        while time.monotonic() < until:
            told = self.good(f"/jobs/{job}", role="observer")
            if told.get("stage") in ("done", "failed", "cancelled", None):
                return told
            time.sleep(0.1)
        expect(f"job {job} ends", False)
        return {}


def read(path):
    with open(path, "rb") as file:
        return file.read()


def command_line(settings, *words):
    before, after = settings["trammel"][:1], settings["trammel"][1:]
    return subprocess.run([*before, *words, *after], capture_output=True, check=False)


def by_command_line(settings, words, name):
    """What it writes as JSON to a file of this name."""
    path = os.path.join(settings["folder"], name)
    done = command_line(settings, *words, "--json", path)
    expect(" ".join(words), done.returncode == 0, done.stderr)
    return json.loads(read(path)) if done.returncode == 0 else {}


def work(service, settings):
    """Everything that a CAM office and a metrologist do, in their order."""
    for number, batch in enumerate(settings["batches"], 1):
        path = f"/cells/cell-7/batches?batch_id=b{number}"
        code, told = service.curl(path, "-H", "Content-Type: text/csv", "--data-binary", "@" + batch,
                                  role="metrologist")
        expect("submit", code == 200, told)
        job = service.ended(json.loads(told)["job"])
        expect("the training is done", job.get("stage") == "done", job)
    models = service.good("/cells/cell-7/models", role="observer")["models"]
    in_force = [model["version"] for model in models if model["in_force"]]
    expect("a version is in force", len(in_force) == 1, models)
    numbers(service, settings)
    versions(service, in_force[0], [model["version"] for model in models])
    job = service.good("/cells/cell-7/train", {"batch_ids": ["b1"], "bias": "none"}).get("job", 0)
    expect("train", service.ended(job).get("stage") == "done", job)
    for what in ("check", "diagnose"):
        body = b"\n".join(read(settings["batches"][1]).splitlines()[:13]) + b"\n"
        if what == "diagnose":
            body = read(settings["batches"][1])
        job = service.good(f"/cells/cell-7/{what}", body, kind=CSV, role="metrologist").get("job", 0)
        expect(what, service.ended(job).get("stage") == "done", job)
        service.good(f"/cells/cell-7/jobs/{job}/findings", role="observer")
    expect("status", service.good("/status", role="observer")["cells"][0]["cell"] == "cell-7")
    jobs = service.good("/jobs?cell=cell-7", role="observer")["jobs"]
    expect("jobs", [job["kind"] for job in jobs][:3] == ["train", "train", "train"], jobs)
    trail = command_line(settings, "audit").stdout.decode()
    expect("the audit trail names who asked", "one-metrologist" in trail and "one-engineer" in trail,
           trail)


def numbers(service, settings):
    """The figures are those of the command line."""
    joints = os.path.join(settings["folder"], "joints.csv")
    rows = [[5, 10, 15, 20, 25, 30], [-40, 20, 5, 60, 40, -100]]
    with open(joints, "w", encoding="utf-8") as file:
        file.write("pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n")
        file.writelines(f"p{i}," + ",".join(map(str, row)) + "\n" for i, row in enumerate(rows))
    asked = {"poses": [{"pose_id": f"p{i}", "joints_deg": row} for i, row in enumerate(rows)]}
    ours = by_command_line(settings, ["predict", "cell-7", "--joints", joints, "-o",
                                      os.path.join(settings["folder"], "predicted.csv")],
                           "predicted.json")
    told = service.good("/cells/cell-7/predict", asked, role="cam")
    expect("predict", told.get("predictions") == ours.get("predictions"), (told, ours))
    code, body = service.curl("/cells/cell-7/predict", "-H", "Content-Type: application/json", "-d",
                              json.dumps(asked), role="cam")
    expect("predict by curl", code == 200 and json.loads(body) == told, body)
    pose = told["predictions"][0]["nominal"]
    targets = {"targets": [{"name": "t1", **pose, **HOME}, {"name": "t2", **HOME}]}
    corrected = service.good("/cells/cell-7/correct", targets, role="cam")["targets"]
    expect("correct", [target["status"] for target in corrected] == ["ok", "ok"], corrected)
    for axis in "xyz":  # both targets are the same place
        apart = abs(corrected[0]["commanded"][axis + "_mm"] - corrected[1]["commanded"][axis + "_mm"])
        expect("a joint target and its pose", apart < 1e-6, corrected)


def versions(service, in_force, all_versions):
    """There and back; a stale expectation is a conflict."""
    other = [version for version in all_versions if version != in_force][0]
    change = {"version": other, "expected_version": in_force, "force": True, "change_id": "c1",
              "reason": "compared"}
    for _ in range(2):  # sent again, it happens once
        told = service.good("/cells/cell-7/activate", change)
        expect("activate", told.get("version") == other, told)
    code, told, _ = service.ask("/cells/cell-7/activate", {"version": in_force, "expected_version": 99})
    expect("a stale expectation", code == 409, told)
    told = service.good("/cells/cell-7/rollback", {"reason": "back"})
    expect("rollback", told.get("version") == in_force, told)


def dialects(service, settings):
    """Every sample program comes back as the command line writes it, byte for byte."""
    service.curl("/cells/cell-7/batches?batch_id=b1", "-H", "Content-Type: text/csv", "--data-binary",
                 "@" + settings["batches"][0])
    service.ended(1)
    for dialect in sorted(os.listdir(settings["programs"])):
        folder = os.path.join(settings["programs"], dialect)
        if not os.path.isdir(folder):
            continue
        corrected = 0
        for program in sorted(os.listdir(folder)):
            corrected += one_program(service, settings, dialect, os.path.join(folder, program))
        expect(f"a {dialect} program is corrected", corrected > 0)


def one_program(service, settings, dialect, folder):
    """How many of its targets were corrected."""
    names = sorted(os.listdir(folder))
    paths = [os.path.join(folder, name) for name in names]
    out = os.path.join(settings["folder"], dialect + "-" + os.path.basename(folder))
    options = ["--format", dialect, "--tool", "spindle", "--allow-failed"]
    body = {"files": [{"name": name, "base64": base64.b64encode(read(path)).decode()}
                      for name, path in zip(names, paths)], "format": dialect, "tool": "spindle"}
    spelled = {"fanuc": ("UTOOL", "UFRAME", "UFRAME"), "inform": ("TOOL", "USER", "USER")}.get(dialect)
    if spelled:
        body["frames"] = FRAMES % spelled
        table = os.path.join(settings["folder"], dialect + "_frames.csv")
        with open(table, "w", encoding="utf-8") as file:
            file.write(body["frames"])
        options += ["--frames", table]
    done = command_line(settings, "correct", "cell-7", *paths, "-o", out, *options)
    expect("correct " + folder, done.returncode == 0, done.stderr)
    told = service.good("/cells/cell-7/programs", body, role="cam")
    for file in told.get("files", []):
        ours = read(os.path.join(out, file["name"]) if os.path.isdir(out) else out)
        expect(f"{folder} {file['name']}, byte for byte", base64.b64decode(file["base64"]) == ours)
    if len(names) == 1 and not spelled:
        path = f"/cells/cell-7/program?name={urllib.parse.quote(names[0])}&format={dialect}&tool=spindle"
        code, alone = service.curl(path, "-H", "Content-Type: " + BYTES, "-H", "Expect:", "--data-binary",
                                   "@" + paths[0], role="cam")
        expect(folder + " by curl", code == 200 and alone == read(out), alone[:300])
    return sum(target["status"] == "ok" for target in told.get("receipt", {}).get("targets", []))


def mistakes(service, settings):
    """Each is refused with its code, and in words that name it."""
    service.ended(service.good("/cells/cell-7/batches?batch_id=b1", read(settings["batches"][0]),
                               kind=CSV)["job"])
    cell, one = "/cells/cell-7", {"poses": [HOME]}
    program = {"name": "m.mod", "base64": base64.b64encode(RAPID).decode()}
    deep = b'{"poses": ' + b"[" * 5000 + b"]" * 5000 + b"}"
    batch = read(settings["batches"][0])
    table = [
        # path, body, code, words, and what differs from an engineer's JSON
        (cell + "/predict", b"{", 400, "no JSON object"),
        (cell + "/predict", b"[1]", 400, "no JSON object"),
        (cell + "/predict", b"\xff\xfe{}", 400, "no JSON object"),
        (cell + "/predict", deep, 413, "inside one another, limit 16"),
        (cell + "/predict", {}, 400, "'poses': expected a list"),
        (cell + "/predict", {"poses": [], "tolls": 1}, 400, "'tolls'"),
        (cell + "/predict", {"poses": [{"joints_deg": "5"}]}, 400, "joint vector 1"),
        (cell + "/predict", {"poses": [HOME, {"joints_deg": [1, 2]}]}, 422, "joint vector 2"),
        (cell + "/predict", {"poses": [{"joints_deg": [1, 2, 3, 4, 5, 1e9]}]}, 422, "joint"),
        (cell + "/predict", {"poses": [HOME] * 10001}, 413, "10000"),
        (cell + "/predict", {**one, "tool": "drill"}, 422, "drill"),
        (cell + "/predict", {**one, "model": "@9"}, 404, "9"),
        ("/cells/cell-9/predict", one, 404, "cell-9"),
        (cell + "/correct", {"targets": [{"x_mm": 1, "conf": 0}]}, 400, "target 1"),
        (cell + "/correct", {"targets": [{**HOME, "conf": 0}]}, 400, "either a branch or joints"),
        (cell + "/programs", {"files": []}, 400, "no file"),
        (cell + "/programs", {"files": [program, program]}, 400, "two of one name"),
        (cell + "/programs", {"files": [{"name": "m.mod", "base64": "*"}]}, 400, "expected Base64"),
        (cell + "/programs", {"files": [program], "format": "gcode"}, 400, "gcode"),
        (cell + "/programs", {"files": [program], "frames": "name\nx\n"}, 422, "frames"),
        (cell + "/programs", {"files": [program], "frames": FRAMES % ("A", "B", "C")}, 200, ""),
        (cell + "/program", RAPID, 400, "'name' is missing", {"kind": BYTES}),
        (cell + "/program?name=m.mod&tol=1", RAPID, 400, "'tol'", {"kind": BYTES}),
        (cell + "/program?name=m.mod", b"", 422, "no motion", {"kind": BYTES}),
        (cell + "/program?name=m.mod", RAPID, 415, "application/json", {"kind": "text/plain"}),
        (cell + "/batches?batch_id=b9", b"pose_id,q1_deg\n1,x\n", 422, "q1_deg", {"kind": CSV}),
        (cell + "/batches?batch_id=b1", read(settings["batches"][1]), 409, "b1", {"kind": CSV}),
        (cell + "/batches?batch_id=", batch, 400, "'batch_id' is missing", {"kind": CSV}),
        (cell + "/check?tolerance_mm=soon", batch, 400, "soon", {"kind": CSV}),
        (cell + "/check?tolerance_mm=-1", batch, 400, "tolerance", {"kind": CSV}),
        (cell + "/activate", {"version": 77}, 404, "77"),
        (cell + "/activate", {"version": 1.5}, 400, "whole number"),
        (cell + "/rollback", {"version": 1}, 400, "'version'"),
        (cell + "/rollback", {}, 404, "before"),
        (cell + "/train", {"batch_ids": ["b77"]}, 404, "b77"),
        (cell + "/train", {"bias": "magic"}, 422, "magic"),
        ("/jobs/none", None, 400, "none"),
        ("/jobs/999", None, 404, "999"),
        ("/jobs", {}, 405, "send GET"),
        ("/nothing", None, 404, "no such address"),
        (cell + "/predict", one, 400, "expected 1 to 120000 ms",
         {"headers": {"Trammel-Deadline-Ms": "soon"}}),
        (cell + "/predict", one, 413, "trace", {"headers": {"Trammel-Trace": "x" * 65}}),
        (cell + "/predict", one, 401, "Bearer", {"role": None}),
        (cell + "/predict", one, 401, "Bearer", {"role": "no token of this server"}),
        (cell + "/predict", one, 403, "cam", {"role": "observer"}),
        (cell + "/batches?batch_id=b8", batch, 403, "metrologist", {"kind": CSV, "role": "cam"}),
        (cell + "/activate", {"version": 1}, 403, "engineer", {"role": "metrologist"}),
        (cell + "/predict", one, 403, "another site", {"headers": {"Origin": "https://evil.example"}}),
        (cell + "/predict?" + "x" * 600, one, 400, "option"),
        ("/" + "x" * 600, {}, 414, "too long"),
        ("/jobs", None, 405, "nothing can be changed", {"method": "DELETE"}),
    ]
    large = os.path.join(settings["folder"], "large")
    with open(large, "wb") as file:
        file.truncate(33 << 20)
    told = service.curl(cell + "/predict", "-H", "Content-Type: application/json", "-H", "Expect:",
                        "--data-binary", "@" + large)
    expect("a body that is too large", told[0] == 413 and b"33554432" in told[1], told)
    for path, body, wanted, words, *more in table:
        try:
            code, told, headers = service.ask(path, body, **(more[0] if more else {}))
        except (urllib.error.URLError, ConnectionError) as gone:
            expect(f"{path} {str(body)[:80]}", False, gone)
            continue
        good = code == wanted and words in told.decode(errors="replace")
        expect(f"{path} {str(body)[:80]} is {wanted} with '{words}'", good, (code, told))
        if code != 200 and headers.get_content_type() == JSON:
            expect(f"{path} {str(body)[:80]} has a code", json.loads(told)["error"].get("code"), told)
    plain = http.client.HTTPConnection(service.url.split("/")[2], timeout=20)
    try:
        plain.request("GET", "/api/v1/status")
        expect("no TLS, no answer", plain.getresponse().status >= 400)
    except (http.client.HTTPException, ConnectionError):
        pass


def limits(service, settings):
    """One client that asks for too much is told so; the others go on."""
    service.ended(service.good("/cells/cell-7/batches?batch_id=b1", read(settings["batches"][0]),
                               kind=CSV)["job"])
    many = json.dumps({"targets": [{"name": str(i), **HOME} for i in range(10000)]}).encode()
    told, ended = [], []

    def flood():
        code, body, headers = service.ask("/cells/cell-7/correct", many, role="cam")
        told.append((code, body, headers))
        ended.append(time.monotonic())

    threads = [threading.Thread(target=flood) for _ in range(14)]
    for thread in threads:
        thread.start()
    others = []
    while any(thread.is_alive() for thread in threads):
        code, body, _ = service.ask("/cells/cell-7/predict", {"poses": [HOME]}, role="metrologist")
        others.append((time.monotonic(), code))
    for thread in threads:
        thread.join()
    codes = sorted(code for code, _, _ in told)
    expect("one client has a share", 200 in codes and 503 in codes and set(codes) <= {200, 503}, codes)
    for code, body, headers in told:
        if code == 503:
            expect("told when to ask again", int(headers["Retry-After"]) >= 1, headers)
            expect("busy in words", json.loads(body)["error"]["result"] == "busy", body)
    expect("nobody else is refused", all(code == 200 for _, code in others), others)
    before = sum(when < max(ended) for when, _ in others)
    expect("another client is served between", before >= 3, (others, ended))

    late = []

    def hurried():
        late.append(service.ask("/cells/cell-7/correct", many, role="cam",
                                headers={"Trammel-Deadline-Ms": "1"}))

    threads = [threading.Thread(target=hurried) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    codes = [code for code, _, _ in late]
    expect("a deadline that cannot be kept", set(codes) <= {503, 504}, codes)
    for _, body, headers in late:
        expect("late in words", json.loads(body)["error"]["result"] in ("busy", "deadline_missed"), body)
        expect("late: when to ask again", int(headers["Retry-After"]) >= 1, headers)


def full(service, settings):
    """The queue of the server has room for one request: who finds none is told, and asks again."""
    service.ended(service.good("/cells/cell-7/batches?batch_id=b1", read(settings["batches"][0]),
                               kind=CSV)["job"])
    many = json.dumps({"targets": [{"name": str(i), **HOME} for i in range(5000)]}).encode()
    busy, answered = [], []

    def insist(role):
        until = time.monotonic() + 100
        while time.monotonic() < until:
            code, body, headers = service.ask("/cells/cell-7/correct", many, role=role)
            if code != 503:
                return answered.append(code)
            busy.append((json.loads(body)["error"], headers["Retry-After"]))
            time.sleep(0.05)  # sooner than told, so that the queue stays full

    threads = [threading.Thread(target=insist, args=(role,)) for role in ("cam", "engineer") * 3]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    expect("everybody is answered in the end", answered == [200] * 6, answered)
    expect("some found the queue full", busy)
    for error, after in busy:
        expect("full in words", error["result"] == "busy" and "try again" in error["sentence"], error)
        expect("when to ask again", after and int(after) >= 1, after)


def main():
    task, path = sys.argv[1:]
    settings = json.loads(read(path))
    {"work": work, "dialects": dialects, "mistakes": mistakes, "limits": limits, "full": full}[task](
        Service(settings), settings)
    sys.exit(1 if FAILED else 0)


if __name__ == "__main__":
    main()
