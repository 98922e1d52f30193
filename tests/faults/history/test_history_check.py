"""Histories made by hand, good and bad, for history_check.py: python3 -m unittest test_history_check"""
import json
import random
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import history_check


def asked(operation, invoke, complete, answer="ok", **more):
    return {"op": operation, "cell": "c", "client": 1, "invoke": invoke, "complete": complete, "answer": answer, **more}


def submit(batch, invoke, complete, answer="ok", text="t", job=None):
    return asked("submit", invoke, complete, answer, batch=batch, hash=text, value=job if answer == "ok" else None)


def made(version, in_force, invoke=0, text=None):
    return {"op": "made", "cell": "c", "version": version, "in_force": in_force, "invoke": invoke, "hash": text or f"h{version}"}


def activate(name, version, invoke, complete, answer="ok", **more):
    return asked("activate", invoke, complete, answer, id=name, version=version, value=version if answer == "ok" else None, **more)


def rollback(name, to, invoke, complete, answer="ok", **more):
    return asked("rollback", invoke, complete, answer, id=name, value=to, **more)


def models(in_force, newest, invoke, complete, **more):
    return asked("models", invoke, complete, in_force=in_force, newest=newest, **more)


def end(batches=(), changes=(), jobs=(), twice=()):
    return {"op": "end", "cell": "c", "batches": {b: {"hash": "t"} for b in batches}, "changes": list(changes),
            "jobs": {str(j): "done" for j in jobs}, "twice": list(twice)}


class HistoryCheck(unittest.TestCase):
    def found(self, *records):
        figures = history_check.check(list(records)).figures
        return {name: figures[name] for name in history_check.BAD if figures[name]}

    def good(self, *records):
        report = history_check.check(list(records))
        self.assertEqual([], report.problems)

    def test_what_happened_one_after_the_other(self):
        self.good(submit("b1", 0, 1, job=1), made(1, True), models(1, 1, 5, 6), submit("b2", 7, 8, job=2), made(2, False, 7),
                  models(1, 2, 9, 10), activate("a", 2, 11, 12, expected=1), rollback("r", 1, 13, 14, expected=2),
                  activate("stale", 1, 15, 16, "conflict", expected=2, about="expected"),
                  end(["b1", "b2"], ["a", "r"], [1, 2]))

    def test_what_overlaps_may_have_happened_in_any_order(self):
        self.good(made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, 9), activate("b", 2, 4, 8),
                  models(1, 2, 5, 6), models(2, 2, 10, 11))
        self.good(made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, 9), activate("b", 2, 4, 8),
                  models(1, 2, 10, 11))

    def test_what_was_not_answered_may_have_happened_later_or_never(self):
        first = [made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, None, "unknown")]
        self.good(*first, models(2, 2, 50, 51))
        self.good(*first, models(2, 2, 50, 51), models(1, 2, 60, 61))
        self.assertIn("without an order", self.found(*first, models(1, 2, 60, 61), models(2, 2, 70, 71)))

    def test_an_acknowledged_batch_that_is_gone(self):
        self.assertEqual({"lost": 1}, self.found(submit("b1", 0, 1, job=1), end([], [], [1])))
        self.assertEqual({"without an order": 1}, self.found(
            submit("b1", 0, 1, job=1), asked("read", 2, 3, "not_found", batch="b1", state="absent")))
        self.good(submit("b1", 0, None, "unknown"), asked("read", 2, 3, "not_found", batch="b1", state="absent"), end())

    def test_an_acknowledged_change_that_is_gone(self):
        self.assertEqual({"lost": 1}, self.found(made(1, True), activate("a", 1, 2, 3), end()))
        self.assertIn("without an order", self.found(
            made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, 4), models(2, 2, 5, 6)))

    def test_an_acknowledged_job_that_is_gone_or_stuck(self):
        self.assertEqual({"lost": 1}, self.found(submit("b1", 0, 1, job=1), end(["b1"])))
        stuck = end(["b1"], [], [1])
        stuck["jobs"]["1"] = "running"
        self.assertEqual({"jobs not ended": 1}, self.found(submit("b1", 0, 1, job=1), stuck))

    def test_a_rollback_that_was_made_twice(self):
        before = [made(1, True), made(2, True), made(3, True), models(3, 3, 1, 2), rollback("r", None, 3, None, "unknown"),
                  rollback("r", 2, 10, 11)]
        self.good(*before, models(2, 3, 12, 13))
        self.assertIn("without an order", self.found(*before, models(1, 3, 12, 13)))
        self.assertEqual({"made twice": 1}, self.found(*before, end([], ["r"], [], ["rollback r"])))

    def test_a_repeat_that_is_answered_otherwise(self):
        self.assertIn("made twice", self.found(
            made(1, True), made(2, True), made(3, True), rollback("r", 2, 3, 4), rollback("r", 1, 5, 6)))

    def test_a_repeat_that_is_refused_though_it_was_made(self):
        self.assertIn("without an order", self.found(
            made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, 4, expected=2),
            activate("a", 1, 5, 6, "conflict", expected=2, about="expected")))

    def test_a_repeat_changes_nothing(self):
        self.good(made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, 4), activate("b", 2, 5, 6),
                  activate("a", 1, 7, 8), models(2, 2, 9, 10))

    def test_one_number_of_two_models(self):
        self.assertEqual({"one number two models": 1}, self.found(
            made(1, True), asked("predict", 5, 6, version=1, hash="another")))
        self.assertEqual({"one number two models": 1}, self.found(
            made(1, True), models(1, 1, 5, 6, versions={"1": "another"})))

    def test_a_number_that_was_never_given_or_goes_back(self):
        self.assertIn("without an order", self.found(made(1, True), models(1, 2, 5, 6)))
        self.assertIn("without an order", self.found(made(1, True), made(2, False), models(1, 2, 5, 6), models(1, 1, 7, 8)))

    def test_a_stale_decision_that_was_accepted(self):
        first = [made(1, True), made(2, True), models(2, 2, 1, 2)]
        self.assertIn("without an order", self.found(*first, activate("a", 1, 3, 4, expected=1)))
        self.assertIn("without an order", self.found(*first, rollback("r", 1, 3, 4, expected=1)))
        self.assertIn("without an order", self.found(*first, submit("b", 0, 1, job=1), asked(
            "discard", 3, 4, id="d", batch="b", expected=1)))
        self.assertIn("without an order", self.found(*first, asked("train", 3, 4, id="t", expected=1, value=7)))

    def test_a_good_decision_that_was_refused(self):
        self.assertIn("without an order", self.found(made(1, True), models(1, 1, 1, 2), activate(
            "a", 1, 3, 4, "conflict", expected=1, about="expected")))

    def test_a_stale_read(self):
        self.assertIn("without an order", self.found(
            made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, 4), models(2, 2, 5, 6), models(1, 2, 7, 8)))

    def test_a_rollback_that_goes_two_steps_back(self):
        first = [made(1, True), made(2, True), made(3, True), models(3, 3, 1, 2)]
        self.good(*first, rollback("r", 2, 3, 4), rollback("s", 1, 5, 6), rollback("t", None, 7, 8, "not_found"))
        self.assertIn("without an order", self.found(*first, rollback("r", 1, 3, 4)))
        self.assertIn("without an order", self.found(*first, rollback("r", None, 3, 4, "not_found")))

    def test_batches(self):
        self.good(submit("b", 0, 1, job=1), submit("b", 2, 3, job=1), submit("b", 4, 5, "conflict", "other"))
        self.assertIn("without an order", self.found(submit("b", 0, 1, job=1), submit("b", 2, 3, job=2)))
        self.assertIn("without an order", self.found(submit("b", 0, 1, job=1), submit("b", 2, 3, "ok", "other", 1)))
        discard, release = (lambda at, how="ok", op=op: asked(op, at, at + 1, how, id=f"{op}{at}", batch="b")
                            for op in ("discard", "release"))
        state = lambda at, what: asked("read", at, at + 1, batch="b", state=what, hash="t")
        kept_out = {"op": "quarantined", "cell": "c", "batch": "b", "invoke": 2}
        self.good(submit("b", 0, 1, job=1), release(2, "conflict"), kept_out, state(4, "quarantine"), release(6), state(8, "free"),
                  discard(10), state(12, "discarded"), release(14, "conflict"), state(16, "present"))
        self.assertIn("without an order", self.found(submit("b", 0, 1, job=1), discard(2), state(4, "free")))
        self.assertIn("without an order", self.found(submit("b", 0, 1, job=1), discard(2), release(4)))

    def test_predictions_that_failed(self):
        self.assertEqual({"predictions failed": 2}, self.found({"op": "predictions", "asked": 10, "failed": 2}))

    def test_a_history_of_many_at_once_without_a_hint(self):
        for seed in range(5):
            self.good(*random_history(random.Random(seed), 150)[0])

    def test_a_long_history_with_what_the_record_says(self):
        """Made by running operations in an order; times are drawn around it. What is read is then spoilt in one place."""
        for seed in range(2):
            history, order = random_history(random.Random(seed), 3000)
            history.append({**end(), "op": "end", "order": order})
            keep = [record for record in history if record["op"] != "end"]
            self.assertEqual({}, self.without_loss(*history))
            reads = [i for i, record in enumerate(keep) if record["op"] == "models" and record["newest"] > 3]
            spoilt = random.Random(seed).choice(reads)
            history[spoilt] = {**history[spoilt], "newest": history[spoilt]["newest"] + 3}
            self.assertTrue({"without an order", "not decided"} & set(self.without_loss(*history)))

    def test_a_hint_that_is_wrong_is_no_more_than_a_hint(self):
        first = [made(1, True), made(2, True), models(2, 2, 1, 2), activate("a", 1, 3, 4), models(1, 2, 5, 6), activate("b", 2, 7, 8),
                 models(2, 2, 9, 10)]
        self.assertEqual({}, self.without_loss(*first, {**end(), "order": ["b", "version 2", "a", "version 1"]}))
        self.assertIn("without an order", self.without_loss(
            *first, models(1, 2, 11, 12), {**end(), "order": ["version 1", "version 2", "b", "a"]}))

    def without_loss(self, *records):
        return {name: count for name, count in self.found(*records).items() if name != "lost"}

    def test_the_program(self):
        with tempfile.TemporaryDirectory() as folder:
            for records, code in (([submit("b", 0, 1, job=1), end(["b"], [], [1])], 0), ([submit("b", 0, 1, job=1), end()], 1)):
                path = Path(folder, "history")
                path.write_text("".join(json.dumps(record) + "\n" for record in records), encoding="utf-8")
                told = subprocess.run([sys.executable, history_check.__file__, path], capture_output=True, text=True, check=False)
                self.assertEqual(code, told.returncode, told.stdout + told.stderr)
                self.assertIn("figure kills: acknowledged: 1\n", told.stdout)
                self.assertIn(f"figure kills: lost: {2 * code}\n", told.stdout)


def random_history(random_numbers, count):
    """Four clients whose operations overlap; some are not answered and happened, or did not."""
    stack, last, records, clients, order = [], 0, [], [0] * 4, []
    for moment in range(100, 100 * count, 100):
        client = random_numbers.randrange(4)
        invoke = max(clients[client] + 1, moment - random_numbers.randrange(300))
        complete = moment + random_numbers.randrange(300)
        if invoke > moment:
            continue
        clients[client] = complete
        lost = random_numbers.random() < 0.03
        answer, until = ("unknown", None) if lost else ("ok", complete)
        what = random_numbers.randrange(5)
        if what == 0 and random_numbers.random() < 0.3:
            last += 1
            in_force = random_numbers.random() < 0.5
            if in_force:
                stack.append(last)
            records.append(made(last, in_force, max(0, moment - 2000)))
            order.append(f"version {last}")
        elif what == 1 and last > 0:
            version = random_numbers.randint(1, last)
            if not lost or random_numbers.random() < 0.5:
                if not stack or stack[-1] != version:
                    stack.append(version)
                    order.append(f"a{moment}")
            records.append(activate(f"a{moment}", version, invoke, until, answer))
        elif what == 2 and len(stack) > 1:
            if not lost or random_numbers.random() < 0.5:
                stack.pop()
                order.append(f"r{moment}")
                records.append(rollback(f"r{moment}", None if lost else stack[-1], invoke, until, answer))
        elif what == 3 and last > 0:
            version, expected = random_numbers.randint(1, last), random_numbers.randint(1, last)
            if expected == (stack[-1] if stack else 0):
                if stack[-1] != version:
                    stack.append(version)
                    order.append(f"e{moment}")
                records.append(activate(f"e{moment}", version, invoke, complete, expected=expected))
            else:
                records.append(activate(f"e{moment}", version, invoke, complete, "conflict", expected=expected, about="expected"))
        elif not lost:
            records.append(models(stack[-1] if stack else 0, last, invoke, complete))
    return records, order


if __name__ == "__main__":
    unittest.main()
