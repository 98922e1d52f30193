#!/usr/bin/python3
"""Checks what clients asked of a fleet and were answered. It knows nothing of the product but what is written here.

    history_check.py HISTORY

HISTORY has a JSON object a line (README.md beside this file). Prints what was lost, made twice, and whether each cell and
each batch can be explained by one order of the operations that agrees with their times (linearizability: the search of Wing
and Gong, with Lowe's memory of what was tried). Exit code 0: all is well, 1: it is not, 2: the search was given up.
"""
import collections
import json
import sys

FOREVER = float("inf")
MOST_STEPS = 300_000  # of a search, before it is given up
CHANGES = ("activate", "rollback", "release", "discard", "train")


class Undecided(Exception):
    """The search took too long."""


class Operation:
    """Happens at one moment between `invoke` and `complete`; an optional one may also never happen."""

    def __init__(self, record, invoke, complete, optional=False):
        self.record, self.invoke, self.complete, self.optional = record, invoke, complete, optional
        self.before = None  # another operation that must not have happened before this one
        self.hint = FOREVER  # when the record says that it was made

    def __str__(self):
        told = {k: v for k, v in self.record.items() if k not in ("invoke", "complete", "versions")}
        end = "" if self.complete == FOREVER else self.complete
        return f"[{self.invoke}..{end}] {json.dumps(told)}{' (may not have happened)' if self.optional else ''}"


def find_order(operations, state, step, only_reads):
    """None if there is an order, else the operation that none could be found for.

    step(state, record) is the state behind the operation, or None where its answer is not possible in this state. Whatever only
    reads is taken as soon as its answer is possible: it can stand in nobody's way. What changes something is tried in the order
    in which the record says that it was made, if it does: a hint, and no more. What may have happened is tried last. A place
    that was reached with fewer of these is not tried again: whatever goes on from here went on from there, too."""
    must = sorted((o for o in operations if not o.optional), key=lambda o: o.invoke)
    may = sorted((o for o in operations if o.optional), key=lambda o: o.invoke)
    bit_of = {id(o): 1 << i for i, o in enumerate(must)}
    bit_of_may = {id(o): 1 << i for i, o in enumerate(may)}
    tried = collections.defaultdict(list)  # the optional ones that were made, by those that must have been and the state
    farthest, steps = (-1, None), 0

    def is_too_late(one, done, made):
        return one.before is not None and (
            done & bit_of.get(id(one.before), 0) or made & bit_of_may.get(id(one.before), 0))

    def next_ones(first, done, made, state):
        """What may be the next: what begins before anything that is left has ended. With the state behind it."""
        end, left = FOREVER, []
        for i in range(first, len(must)):
            if must[i].invoke > end:
                break
            if not done >> i & 1:
                left.append(must[i])
                end = min(end, must[i].complete)
        left = [o for o in left if o.invoke <= end]
        nonlocal farthest
        if left and end > farthest[0]:
            farthest = (end, min(left, key=lambda o: o.complete))
        for o in may:
            if o.invoke > end:
                break
            if not made & bit_of_may[id(o)]:
                left.append(o)
        fitting = []
        for one in left:
            behind = None if is_too_late(one, done, made) else step(state, one.record)
            if behind is None:
                continue
            if only_reads(one.record) and not one.optional:
                return iter([(one, behind)])
            changes_nothing = behind == state and one.hint == FOREVER and not one.optional
            fitting.append(((not changes_nothing, one.hint, one.optional, one.complete), one, behind))
        fitting.sort(key=lambda tried: tried[0])
        return iter([(one, behind) for _, one, behind in fitting])

    everything = (1 << len(must)) - 1
    way = [(0, 0, 0, next_ones(0, 0, 0, state))]
    while way:
        first, done, made, ones = way[-1]
        if done == everything:
            return None
        one, behind = next(ones, (None, None))
        if one is None:
            way.pop()
            continue
        steps += 1
        if steps > MOST_STEPS:
            raise Undecided()
        done, made = done | bit_of.get(id(one), 0), made | bit_of_may.get(id(one), 0)
        with_fewer = tried[done, behind]
        if any(before & made == before for before in with_fewer):
            continue
        with_fewer.append(made)
        while done >> first & 1:
            first += 1
        way.append((first, done, made, next_ones(first, done, made, behind)))
    return farthest[1]


class Cell:
    """Which version is in force, and where a rollback leads. A state is (what is in force, the highest number)."""

    START = (0, 0)

    def __init__(self):
        self.nodes, self.numbers = [(0, 0)], {}  # (version, the node before); node 0: nothing is in force

    def on_top(self, node, version):
        if self.nodes[node][0] == version:
            return node
        key = (version, node)
        if key not in self.numbers:
            self.numbers[key] = len(self.nodes)
            self.nodes.append(key)
        return self.numbers[key]

    def step(self, state, record):
        node, last = state
        present, before = self.nodes[node]
        operation, answer, expected = record["op"], record.get("answer"), record.get("expected")
        if operation == "made":
            if record["version"] != last + 1:
                return None
            return (self.on_top(node, last + 1) if record["in_force"] else node, last + 1)
        if operation == "models":
            return state if (record["in_force"], record["newest"]) == (present, last) else None
        if answer == "conflict":
            return state if expected is not None and expected != present else None
        if answer == "not_found":
            missing = record["version"] > last if operation == "activate" else before == 0
            return state if missing else None
        if expected is not None and expected != present:
            return None
        if operation == "activate":
            return (self.on_top(node, record["version"]), last) if record["version"] <= last else None
        if operation == "rollback":
            fits = before != 0 and record.get("value") in (None, self.nodes[before][0])
            return (before, last) if fits else None
        return state  # release, discard, train: only what they expected to be in force


def step_of_batch(state, record):
    """A state is (absent, free, quarantine or discarded; hash; job)."""
    kind, text, job = state
    operation, answer = record["op"], record.get("answer")
    if operation == "submit":
        if kind == "absent":
            return ("free", record["hash"], record.get("value")) if answer != "conflict" else None
        if answer == "conflict":
            return state if record["hash"] != text else None
        if record["hash"] != text:
            return None if answer == "ok" else state
        if job is None:  # the one that was not answered made it
            return (kind, text, record.get("value"))
        return state if record.get("value") in (None, job) else None
    if operation == "read":
        return state if (record["state"] in (kind, "present" if kind != "absent" else "absent")) and (
            record.get("hash") in (None, text)) else None
    if operation == "quarantined":
        return ("quarantine" if kind == "free" else kind, text, job) if kind != "absent" else None
    if answer == "not_found":
        return state if kind == "absent" else None
    if kind == "absent":
        return None
    if operation == "discard":
        return ("discarded", text, job) if answer != "conflict" else None
    if operation == "release":
        if answer == "conflict":
            return state if kind != "quarantine" else None
        return ("free", text, job) if kind == "quarantine" else None
    raise ValueError(operation)


def joined(records):
    """Operations of records of one object. What was asked again under its id is one operation: it happens once, between the
    first time that it was asked and the first time that it was acknowledged."""
    operations, by_id, problems = [], collections.defaultdict(list), []
    for record in records:
        if record["op"] in ("made", "quarantined"):
            operations.append(Operation(record, record["invoke"], FOREVER, True))
        elif record["answer"] == "refused":
            continue  # it changed nothing, and says nothing of what is there
        elif record["op"] in CHANGES and record.get("id"):
            by_id[record["id"]].append(record)
        elif record["answer"] == "unknown":
            if record["op"] not in ("read", "models"):
                operations.append(Operation(record, record["invoke"], FOREVER, True))
        else:
            operations.append(Operation(record, record["invoke"], record["complete"]))
    for asked in by_id.values():
        made = [r for r in asked if r["answer"] == "ok"]
        unknown = [r for r in asked if r["answer"] == "unknown"]
        one = None
        if made:
            if len({json.dumps(r.get("value")) for r in made}) > 1:
                problems.append(f"change {made[0]['id']} was answered in two ways")
            one = Operation(made[0], min(r["invoke"] for r in made + unknown), min(r["complete"] for r in made))
        elif unknown:
            one = Operation(unknown[0], min(r["invoke"] for r in unknown), FOREVER, True)
        if one:
            operations.append(one)
        for refused in (r for r in asked if r["answer"] not in ("ok", "unknown")):
            operations.append(Operation(refused, refused["invoke"], refused["complete"]))
            operations[-1].before = one
    return operations, problems


def only_reads(record):
    operation, answer = record["op"], record.get("answer")
    if operation in ("models", "read") or answer in ("conflict", "not_found"):
        return True
    return "of_cell" in record


def of_cell(record):
    """Whether the operation tells of what is in force."""
    operation, answer = record["op"], record.get("answer")
    if operation in ("activate", "rollback", "made", "models"):
        return True
    if operation not in CHANGES or record.get("expected") is None:
        return False
    return answer == "ok" or (answer == "conflict" and record.get("about") == "expected")


def of_batch(record):
    return record["op"] in ("submit", "read", "quarantined") or (
        record["op"] in ("release", "discard") and record.get("about") != "expected")


class Report:
    def __init__(self):
        self.figures = collections.Counter()
        self.problems = []
        self.undecided = False

    def add(self, figure, problem, by=1):
        self.figures[figure] += by
        self.problems.append(f"{figure}: {problem}")


def check_orders(records, report):
    cells, batches = collections.defaultdict(list), collections.defaultdict(list)
    for record in records:
        if of_cell(record):
            only_expects = record["op"] in ("release", "discard", "train")
            cells[record["cell"]].append({**record, "of_cell": True} if only_expects else record)
        if of_batch(record):
            batches[record["cell"], record["batch"]].append(record)
    orders = {r["cell"]: {key: at for at, key in enumerate(r.get("order", []))} for r in records if r["op"] == "end"}
    for cell, own in cells.items():
        check_order(f"cell {cell}", own, Cell.START, Cell().step, orders.get(cell, {}), report)
    for (cell, batch), own in batches.items():
        check_order(f"batch {batch} of cell {cell}", own, ("absent", None, None), step_of_batch, orders.get(cell, {}), report)
    report.figures["cells"], report.figures["batches"] = len(cells), len(batches)


def check_order(what, records, start, step, hints, report):
    operations, problems = joined(records)
    for operation in operations:
        record = operation.record
        key = f"version {record['version']}" if record["op"] == "made" else record.get("id")
        operation.hint = hints.get(key, FOREVER)
    for problem in problems:
        report.add("made twice", problem)
    try:
        stuck = find_order(operations, start, step, only_reads)
    except Undecided:
        report.undecided = True
        report.add("not decided", f"{what}: {len(operations)} operations")
        return
    if stuck:
        near = sorted((o for o in operations if o.invoke <= stuck.complete and o.complete >= stuck.invoke), key=lambda o: o.invoke)
        report.add("without an order", f"{what}: none explains {stuck}; at the same time:" + "".join(f"\n    {o}" for o in near[:12]))


def check_numbers(records, report):
    """A number is one model's, and a job is one change's."""
    models, jobs = collections.defaultdict(set), collections.defaultdict(set)
    for record in records:
        told = dict(record.get("versions", {}))
        if record["op"] in ("predict", "made") and record.get("answer", "ok") == "ok" and record.get("hash"):
            told[record["version"]] = record["hash"]
        for version, text in told.items():
            models[record["cell"], int(version)].add(text)
        if record["op"] in ("submit", "train") and record.get("answer") == "ok":
            jobs[record["value"]].add((record["cell"], record["op"], record.get("id") or record["batch"]))
    for (cell, version), texts in models.items():
        if len(texts) > 1:
            report.add("one number two models", f"version {version} of cell {cell}: {sorted(texts)}")
    for job, asked in jobs.items():
        if len(asked) > 1:
            report.add("one job two changes", f"job {job}: {sorted(asked)}")


def check_end(records, report):
    """What was acknowledged against what is there in the end."""
    ends = {record["cell"]: record for record in records if record["op"] == "end"}
    acknowledged = set()
    for record in records:
        if record.get("answer") != "ok" or record["op"] not in CHANGES + ("submit",):
            continue
        end = ends.get(record["cell"])
        key = (record["cell"], record["op"], record.get("id") or record["batch"])
        if end is None or key in acknowledged:
            continue
        acknowledged.add(key)
        if record["op"] == "submit":
            kept = end["batches"].get(record["batch"])
            if kept is None or kept["hash"] != record["hash"]:
                report.add("lost", f"batch {record['batch']} of cell {record['cell']}")
        elif record["id"] not in end["changes"]:
            report.add("lost", f"{record['op']} {record['id']} of cell {record['cell']}")
        if record["op"] in ("submit", "train") and str(record["value"]) not in end["jobs"]:
            report.add("lost", f"job {record['value']} of cell {record['cell']}")
    report.figures["acknowledged"] = len(acknowledged)
    for cell, end in ends.items():
        for job, state in end["jobs"].items():
            report.figures["jobs"] += 1
            if state not in ("done", "failed"):
                report.add("jobs not ended", f"job {job} of cell {cell} is {state}")
        for twice in end["twice"]:
            report.add("made twice", f"{twice} of cell {cell}")


def check(records):
    report = Report()
    check_orders(records, report)
    check_numbers(records, report)
    check_end(records, report)
    report.figures["refused"] = sum(r.get("answer") == "refused" for r in records)
    report.figures["unanswered"] = sum(r.get("answer") == "unknown" for r in records)
    predictions = [r for r in records if r["op"] == "predictions"]
    report.figures["predictions"] = sum(r["asked"] for r in predictions)
    failed = sum(r["failed"] for r in predictions)
    if failed:
        report.add("predictions failed", f"{failed} of {report.figures['predictions']}", failed)
    return report


GOOD = ("cells", "batches", "jobs", "acknowledged", "unanswered", "refused", "predictions")
BAD = ("lost", "made twice", "one number two models", "one job two changes", "jobs not ended", "without an order",
       "not decided", "predictions failed")


def main(arguments):
    if len(arguments) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    with open(arguments[1], encoding="utf-8") as lines:
        records = [json.loads(line) for line in lines if line.strip()]
    report = check(records)
    for problem in report.problems:
        print(problem)
    for name in GOOD + BAD:
        print(f"figure kills: {name}: {report.figures[name]}")
    if report.undecided:
        return 2
    return 1 if any(report.figures[name] for name in BAD) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
