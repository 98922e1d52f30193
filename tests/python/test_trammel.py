"""The Python package as somebody uses it: what it returns is what the command line writes, and what goes wrong is data.

TRAMMEL_SOURCE and TRAMMEL_BUILD name the project's folder and its build tree.
"""

import csv
import inspect
import io
import json
import os
import pathlib
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy as np

import trammel

SOURCE = pathlib.Path(os.environ["TRAMMEL_SOURCE"])
BUILD = pathlib.Path(os.environ["TRAMMEL_BUILD"])
CELL = SOURCE / "config/cell-7.yaml"
TRUTH = SOURCE / "models/truth/chapter-5.yaml"


def command_line(*arguments):
    """What `trammel` prints."""
    done = subprocess.run([BUILD / "clients/trammel", *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


class Offline(unittest.TestCase):
    """On files, held against the command line."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.cell = trammel.Cell.load(CELL)
        cls.planned = trammel.plan(cls.cell, 60, seed=3)
        cls.batch = trammel.simulate(cls.cell, TRUTH, cls.planned, seed=3)
        cls.batch_path = cls.folder / "batch.csv"
        cls.batch_path.write_text(cls.batch.csv())
        cls.model = trammel.train(cls.cell, trammel.Batch.load(cls.batch_path), bias="se")
        cls.model_path = cls.folder / "cell.model"
        cls.model.save(cls.model_path)

    def test_plans_the_poses_that_the_command_line_plans(self):
        command_line("plan", "--cell", CELL, "--count", 60, "--seed", 3, "-o", self.folder / "plan.csv")
        self.assertEqual((self.folder / "plan.csv").read_text(), self.planned.csv)
        self.assertEqual(self.planned.joints_deg.shape, (60, 6))

    def test_simulates_the_batch_that_the_command_line_simulates(self):
        (self.folder / "planned.csv").write_text(self.planned.csv)
        command_line("simulate", "--cell", CELL, "--truth", TRUTH, "--plan", self.folder / "planned.csv", "--seed", 3,
                     "-o", self.folder / "simulated.csv")
        self.assertEqual((self.folder / "simulated.csv").read_text(), self.batch.csv())

    def test_trains_the_model_that_the_command_line_trains(self):
        command_line("train", "--cell", CELL, "--batch", self.batch_path, "--bias", "se", "-o", self.folder / "b.model")
        other = trammel.Model.load(self.folder / "b.model")
        self.assertEqual(other.facts["hash"], self.model.facts["hash"])
        self.assertEqual(other.bias, "se")

    def test_a_saved_model_is_the_same_model(self):
        loaded = trammel.Model.load(self.model_path)
        self.assertEqual(loaded.facts, self.model.facts)
        np.testing.assert_array_equal(loaded.predict(self.planned.joints_deg).error_mm,
                                      self.model.predict(self.planned.joints_deg).error_mm)

    def test_predicts_what_the_command_line_predicts(self):
        (self.folder / "j.csv").write_text(self.planned.csv)
        command_line("predict", "--model", self.model_path, "--joints", self.folder / "j.csv", "-o", self.folder / "p.csv")
        rows = list(csv.DictReader(io.StringIO((self.folder / "p.csv").read_text())))
        here = self.model.predict(self.planned.joints_deg)
        for name, column in {"dx_mm": here.error_mm[:, 0], "dz_mm": here.error_mm[:, 2], "sy_mm": here.stddev_mm[:, 1],
                             "z_mm": here.predicted[:, 2], "qx": here.predicted[:, 4]}.items():
            np.testing.assert_allclose([float(row[name]) for row in rows], column, atol=2e-6, err_msg=name)
        np.testing.assert_allclose(np.sqrt(np.einsum("nii->ni", here.covariance_mm2)), here.stddev_mm, rtol=1e-9)
        self.assertTrue((here.true_stddev_mm <= here.stddev_mm).all())

    def test_corrects_as_the_command_line_does(self):
        nominal = self.model.predict(self.planned.joints_deg[:7]).nominal
        names = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"] + [f"q{j}_deg" for j in range(1, 7)]
        lines = [",".join(names)] + [",".join(repr(float(v)) for v in row)
                                     for row in np.hstack([nominal, self.planned.joints_deg[:7]])]
        (self.folder / "t.csv").write_text("\n".join(lines) + "\n")
        command_line("correct", "--allow-failed", "--model", self.model_path, self.folder / "t.csv", "-o",
                     self.folder / "c.csv")
        rows = list(csv.DictReader(io.StringIO((self.folder / "c.csv").read_text())))
        here = self.model.correct(nominal, joints_deg=self.planned.joints_deg[:7])
        self.assertEqual([row["status"] for row in rows], here.status)
        self.assertEqual(here.pose.shape, (7, 7))
        done = [status in ("ok", "out_of_domain") for status in here.status]
        self.assertGreater(sum(done), 3)
        there = [row for row, is_done in zip(rows, done) if is_done]
        np.testing.assert_allclose([float(row["x_mm"]) for row in there], here.pose[done, 0], atol=2e-6)
        np.testing.assert_allclose([float(row["q5_deg"]) for row in there], here.joints_deg[done, 4], atol=2e-6)
        # Commanded so, the tool lands on the wanted pose.
        landed = self.model.predict(here.joints_deg[done]).predicted
        np.testing.assert_allclose(landed[:, :3], nominal[done, :3], atol=1e-3)

    def test_a_joint_target_is_its_nominal_pose(self):
        joints = self.planned.joints_deg[:3]
        np.testing.assert_allclose(self.model.correct(joints_deg=joints).joints_deg,
                                   self.model.correct(self.model.predict(joints).nominal, joints_deg=joints).joints_deg,
                                   atol=1e-6)

    def test_a_branch_stands_for_joints_near_it(self):
        reached = self.model.correct(self.model.predict(np.zeros((1, 6))).nominal + np.eye(7)[0] * 5, conf=0)
        self.assertIn(reached.status[0], ("ok", "out_of_domain", "joint_limit", "singular", "unreachable"))
        self.assertEqual(reached.joints_deg.shape, (1, 6))

    def test_evaluates_with_the_keys_and_figures_of_the_command_line(self):
        printed = json.loads(command_line("evaluate", "--model", self.model_path, "--batch", self.batch_path, "--json", "-"))
        printed.pop("structure", None)
        self.assertIn("coverage_95_stated", printed)
        self.assertAlmostEqual(sum(line["share"] for line in printed.pop("budget")["lines"]), 1, places=9)
        self.assertEqual(printed.pop("notes"), self.model.notes)
        self.assertEqual(printed.pop("measured"), json.loads(json.dumps(self.model.measured)))
        here = self.model.evaluate(trammel.Batch.load(self.batch_path))
        self.assertEqual(json.loads(json.dumps(here)), printed)

    def test_tells_where_the_millimetres_come_from(self):
        budget = self.model.budget()
        self.assertAlmostEqual(sum(line["share"] for line in budget["lines"]), 1, places=9)
        alone = [line["alone_rms_mm"] for line in budget["lines"]]
        self.assertEqual(alone, sorted(alone, reverse=True))
        printed = json.loads(command_line("remedies", "--model", self.model_path, "--json", "-"))
        self.assertEqual([step["step"] for step in printed["steps"]], ["frames", "zeros", "lengths", "loads", "trammel"])
        self.assertEqual(printed["budget"], budget)

    def test_diagnoses_what_the_command_line_diagnoses(self):
        few = trammel.Batch.parse("".join(self.batch.csv().splitlines(keepends=True)[:41]), "few")
        (self.folder / "few.csv").write_text(few.csv())
        printed = json.loads(command_line("diagnose", "--cell", CELL, "--batch", self.folder / "few.csv", "--json", "-"))
        here = trammel.diagnose(self.cell, trammel.Batch.load(self.folder / "few.csv"))
        self.assertEqual(here["verdict"], printed["verdict"])
        self.assertEqual(here["findings"], printed["findings"])

    def test_arrays_are_as_good_as_a_file(self):
        rows = list(csv.DictReader(io.StringIO(self.batch.csv())))
        column = lambda *names: np.array([[float(row[name]) for name in names] for row in rows])
        batch = trammel.Batch.from_arrays(column(*(f"q{j}_deg" for j in range(1, 7))), column("x_mm", "y_mm", "z_mm"),
                                          orientation=column("qw", "qx", "qy", "qz"), pose_id=[row["pose_id"] for row in rows])
        model = trammel.train(self.cell, batch, bias="none")
        same = trammel.train(self.cell, self.batch, bias="none")
        np.testing.assert_allclose(model.predict(self.planned.joints_deg).error_mm,
                                   same.predict(self.planned.joints_deg).error_mm, atol=1e-9)

    def test_pandas_frames_go_in_and_out(self):
        try:
            import pandas
        except ImportError:
            self.skipTest("no pandas here")
        frame = pandas.read_csv(self.batch_path)
        self.assertEqual(len(trammel.Batch.from_frame(frame)), 60)
        self.assertEqual(list(self.model.predict(self.planned.joints_deg).frame().columns[:7]),
                         ["dx_mm", "dy_mm", "dz_mm", "sx_mm", "sy_mm", "sz_mm", "in_domain"])
        self.assertEqual(len(self.model.correct(joints_deg=self.planned.joints_deg[:2]).frame()), 2)
        self.assertEqual(len(self.batch.frame()), 60)

    def test_frames_of_files_are_asked_by_their_columns(self):
        try:
            import pandas
        except ImportError:
            self.skipTest("no pandas here")
        plan = pandas.read_csv(io.StringIO(self.planned.csv), comment="#").iloc[:, ::-1]  # whatever the order
        plan = plan.drop(columns=[name for name in plan.columns if name.startswith("dir")])  # a plan goes both ways
        self.assertIn("pose_id", plan.columns)
        np.testing.assert_allclose(self.model.predict(plan).error_mm, self.model.predict(self.planned.joints_deg).error_mm,
                                   atol=1e-6)
        nominal = self.model.predict(plan[:3]).nominal
        targets = pandas.DataFrame({"pose_id": ["a", "b", "c"], **dict(zip(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"), nominal.T))})
        joints = plan[:3].reset_index(drop=True)
        by_frame = self.model.correct(pandas.concat([targets, joints.drop(columns="pose_id")], axis=1))
        np.testing.assert_allclose(by_frame.joints_deg, self.model.correct(nominal, joints_deg=joints).joints_deg, atol=1e-9)
        np.testing.assert_allclose(by_frame.joints_deg, self.model.correct(joints).joints_deg, atol=1e-5)
        by_branch = self.model.correct(targets.assign(conf=0))
        np.testing.assert_allclose(by_branch.joints_deg, self.model.correct(nominal, conf=0).joints_deg, equal_nan=True)

    def test_parameters_are_in_mm_and_deg(self):
        units = {parameter["unit"] for parameter in self.model.parameters}
        self.assertFalse(units & {"m", "rad"}, units)
        self.assertTrue({"mm", "deg"} & units, units)

    def test_tools_are_where_the_drawing_has_them_without_a_model(self):
        joints = self.planned.joints_deg[:5]
        np.testing.assert_allclose(self.cell.tool_poses(joints)[:, :3], self.model.predict(joints).nominal[:, :3], atol=1e-6)
        flange = self.cell.tool_poses(joints, "flange")
        self.assertGreater(np.linalg.norm(flange[:, :3] - self.cell.tool_poses(joints)[:, :3], axis=1).min(), 1)
        with self.assertRaises(trammel.TrammelError):
            self.cell.tool_poses(joints, "hammer")

    def test_residuals_of_each_pose_add_up_to_the_evaluation(self):
        residuals = self.model.residuals(self.batch)
        figures = self.model.evaluate(self.batch)
        self.assertEqual(len(residuals), figures["poses"])
        for level in ("nominal", "calibrated", "compensated"):
            rms = np.sqrt(np.mean(np.sum(getattr(residuals, f"{level}_mm") ** 2, axis=1)))
            self.assertAlmostEqual(rms, figures["levels"][level]["rms_mm"], places=9)

    def test_a_check_a_page_and_a_history_are_those_of_the_command_line(self):
        few = trammel.simulate(self.cell, TRUTH, trammel.plan(self.cell, 12, criterion="check"), seed=9)
        health = self.model.check(few, tolerance_mm=1)
        self.assertIn(health["verdict"], ("healthy", "cannot_tell"))
        self.assertEqual(len(health["at_poses"]), 12)
        again = self.model.check(few, tolerance_mm=1, earlier=[health])
        self.assertEqual(again["verdict"], health["verdict"])
        self.assertIn(self.model.id, self.model.report())
        self.assertEqual(trammel.history([self.model, self.model])["versions"][1]["model"], self.model.id)

    def test_parameters_have_a_covariance_in_their_units(self):
        u95 = np.array([parameter["u95"] for parameter in self.model.parameters])
        np.testing.assert_allclose(2 * np.sqrt(np.diag(self.model.parameter_covariance)), u95, rtol=1e-6)


class Refusals(unittest.TestCase):
    """What goes wrong says where, which value and which limit."""

    @classmethod
    def setUpClass(cls):
        cls.cell = trammel.Cell.load(CELL)
        cls.batch = trammel.simulate(cls.cell, TRUTH, trammel.plan(cls.cell, 40), seed=1)
        cls.model = trammel.train(cls.cell, cls.batch, level="M1", bias="none")

    def test_a_file_that_is_not_there(self):
        with self.assertRaises(trammel.TrammelError) as raised:
            trammel.Model.load("/nowhere/cell.model")
        self.assertEqual(raised.exception.file, "/nowhere/cell.model")
        self.assertIn("/nowhere/cell.model", str(raised.exception))

    def test_a_row_of_a_batch(self):
        lines = self.batch.csv().splitlines()
        names = lines[0].split(",")
        fields = lines[4].split(",")
        fields[names.index("q3_deg")] = "241.2"
        lines[4] = ",".join(fields)
        with self.assertRaises(trammel.Refused) as raised:
            trammel.train(self.cell, trammel.Batch.parse("\n".join(lines) + "\n", "lt-07"))
        error = raised.exception
        self.assertEqual((error.code, error.row, error.column), ("refused", 5, "q3_deg"))
        self.assertAlmostEqual(error.value, 241.2)
        self.assertIn("lt-07", error.file)
        self.assertIsNotNone(error.limit)

    def test_a_pose_of_an_array(self):
        joints = np.zeros((9, 6))
        joints[7, 4] = 500
        with self.assertRaises(trammel.Refused) as raised:
            self.model.predict(joints)
        self.assertEqual(raised.exception.row, 7)
        self.assertAlmostEqual(raised.exception.value, 500)

    def test_numbers_that_are_none(self):
        for bad in (np.nan, np.inf, 1e300):
            with self.assertRaises(trammel.Refused):
                self.model.predict(np.full((1, 6), bad))
            with self.assertRaises(trammel.Refused):
                self.model.correct(np.full((1, 7), bad), conf=0)

    def test_shapes(self):
        for wrong in (np.zeros(5), np.zeros((3, 7)), np.zeros((2, 3, 6)), np.zeros(())):
            with self.assertRaises(trammel.Usage):
                self.model.predict(wrong)
        with self.assertRaises(trammel.Usage):
            self.model.correct()
        with self.assertRaises(trammel.Usage):
            self.model.correct(np.zeros((2, 7)), joints_deg=np.zeros((3, 6)))
        with self.assertRaises(trammel.Usage):
            self.model.correct(np.zeros((2, 7)), conf=[0, 0, 0])
        self.assertEqual(self.model.predict(np.zeros((0, 6))).error_mm.shape, (0, 3))

    def test_arrays_of_no_numbers(self):
        for wrong in ("joints", [["a"] * 6], None, [[0] * 6, [0] * 5]):
            with self.assertRaises(trammel.Usage):
                self.model.predict(wrong)
        with self.assertRaises(trammel.Usage):
            self.model.correct([["x"] * 7], conf=0)

    def test_a_tool_that_the_cell_has_not(self):
        with self.assertRaises(trammel.Refused) as raised:
            self.model.predict(np.zeros(6), tool="saw")
        self.assertIn("saw", str(raised.exception))

    def test_a_pose_without_a_branch(self):
        with self.assertRaises(trammel.Refused) as raised:
            self.model.correct([[1000, 0, 1000, 1, 0, 0, 0]])
        self.assertEqual(raised.exception.row, 0)

    def test_an_exception_keeps_its_data_on_the_way_from_another_process(self):
        with self.assertRaises(trammel.Refused) as raised:
            self.model.predict(np.full((1, 6), 500.0))
        here, there = raised.exception, pickle.loads(pickle.dumps(raised.exception))
        self.assertEqual(str(there), str(here))
        self.assertEqual((type(there), there.row, there.value, there.limit), (trammel.Refused, 0, here.value, here.limit))

    def test_what_a_notebook_shows(self):
        self.assertEqual(repr(self.cell), "<Cell cell-7: ABB IRB 6640-205/2.75, 6 joints>")
        self.assertEqual(repr(self.batch), "<Batch simulated: 40 poses>")
        self.assertEqual(repr(self.model), f"<Model {self.model.id} of cell-7: base, bias none>")

    def test_a_service_that_is_not_there(self):
        with self.assertRaises(trammel.Unreachable):
            trammel.Session(domain=41, ports=[19999], timeout_s=0.2).status()


    def test_a_path_where_a_cell_or_a_batch_belongs_says_what_is_needed(self):
        with self.assertRaisesRegex(trammel.Usage, r"cell is of type str: a Cell \(Cell.load"):
            trammel.train("cell-7.yaml", self.batch)
        for wrong in ("lt.csv", 7, [self.batch, "lt.csv"], None):
            with self.assertRaisesRegex(trammel.Usage, r"batches is of type \w+: a Batch \(Batch.load"):
                trammel.train(self.cell, wrong)
        with self.assertRaises(trammel.Usage):
            trammel.plan(CELL, 20)

    def test_columns_of_arrays_have_a_value_for_each_pose_or_one_for_all(self):
        joints, position = np.zeros((2, 6)), np.ones((2, 3))
        batch = trammel.Batch.from_arrays(joints, position, pose_id=["a,b", 'c"d'], temperature_c=21.5)
        rows = list(csv.DictReader(io.StringIO(batch.csv())))
        self.assertEqual([(row["pose_id"], row["temperature_c"]) for row in rows], [("a,b", "21.5"), ('c"d', "21.5")])
        with self.assertRaisesRegex(trammel.Usage, "pose_id: 1 values, 2 are needed"):
            trammel.Batch.from_arrays(joints, position, pose_id=["a"])
        with self.assertRaisesRegex(trammel.Usage, "position_mm"):
            trammel.Batch.from_arrays(joints, [["far", "away", "!"]] * 2)

    def test_a_count_or_seed_that_is_no_whole_number_is_refused(self):
        for wrong in (dict(count=-1), dict(count=0), dict(count=1.5), dict(count=5, seed=-1), dict(count=5, seed="x"), dict(count=True)):
            with self.assertRaises(trammel.Usage, msg=repr(wrong)):
                trammel.plan(trammel.Cell.load(CELL), **wrong)

    def test_rails_among_the_joints_of_arrays_are_mm(self):
        batch = trammel.Batch.from_arrays([[1500.0, 10.0, 20.0]], np.ones((1, 3)), rails=[1])
        self.assertEqual(batch.csv().splitlines()[0], "q1_mm,q2_deg,q3_deg,x_mm,y_mm,z_mm")
        with self.assertRaisesRegex(trammel.Usage, "rails: joint 4 of 1 to 3"):
            trammel.Batch.from_arrays(np.zeros((1, 3)), np.ones((1, 3)), rails=[1, 4])


    def test_rows_that_differ_in_approach_are_answered_each_by_its_own_in_their_order(self):
        try:
            import pandas
        except ImportError:
            self.skipTest("no pandas here")
        joints = pandas.DataFrame([[10.0 + k, -30, 40, 0, 30, 0] for k in range(4)], columns=[f"q{j}_deg" for j in range(1, 7)])
        frame = joints.assign(dir2=[1, -1, 1, 0], temperature_c=[20.0, 20.0, 20.0, 31.0],
                              **{f"dir{j}": 0 for j in (1, 3, 4, 5, 6)})
        each = [self.model.predict(joints.iloc[k], directions=[0, frame.dir2[k], 0, 0, 0, 0], temperature_c=frame.temperature_c[k])
                for k in range(4)]
        answer = self.model.predict(frame)
        np.testing.assert_array_equal(answer.predicted, np.vstack([one.predicted for one in each]))
        np.testing.assert_array_equal(answer.in_domain, np.concatenate([one.in_domain for one in each]))
        poses = dict(zip(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"), answer.nominal.T))
        corrected = self.model.correct(joints.assign(temperature_c=frame.temperature_c, **poses))
        np.testing.assert_array_equal(corrected.pose, np.vstack(
            [self.model.correct(joints.assign(**poses).iloc[k], temperature_c=frame.temperature_c[k]).pose for k in range(4)]))
        self.assertEqual(corrected.status, ["ok"] * 4)
        with self.assertRaises(trammel.Refused) as caught:
            self.model.predict(frame.assign(q2_deg=[0.0, 0.0, 0.0, 400.0]))
        self.assertEqual(caught.exception.row, 3)

    def test_columns_of_frames_are_never_taken_for_others(self):
        try:
            import pandas
        except ImportError:
            self.skipTest("no pandas here")
        joints = pandas.DataFrame(np.full((3, 6), [10.0, -30, 40, 0, 30, 0]), columns=[f"q{j}_deg" for j in range(1, 7)])
        right = self.model.predict(joints).error_mm
        np.testing.assert_array_equal(self.model.predict(joints.iloc[:, ::-1].rename(columns=str.upper)).error_mm, right)
        np.testing.assert_array_equal(self.model.predict(joints.iloc[0][::-1]).error_mm, right[:1])
        for wrong, says in ((joints.rename(columns=lambda name: name.replace("deg", "rad")), "missing column q1_deg"),
                            (joints.rename(columns={"q3_deg": "q7_deg"}), "missing column q3_deg"),
                            (joints.rename(columns={"q3_deg": "q3_mm"}), "missing column q3_deg"),
                            (joints.assign(q7_deg=0.0), "7 columns of joints, 6 are needed"),
                            (joints.assign(Q1_DEG=0.0), "two columns q1_deg")):
            with self.assertRaisesRegex(trammel.Usage, says):
                self.model.predict(wrong)
        targets = joints.assign(**dict(zip(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"), self.model.predict(joints).nominal.T)))
        self.assertEqual(self.model.correct(targets.rename(columns=str.upper)).status, ["ok"] * 3)
        for wrong, says in ((targets.drop(columns="qw"), "missing column qw"),
                            (targets.drop(columns=["qw", "qx", "qy", "qz"]), "missing column qw"),
                            (joints.assign(x_m=1.8, y_m=0.1, z_m=1.2), "column x_m is no position in mm")):
            with self.assertRaisesRegex(trammel.Usage, says):
                self.model.correct(wrong)
        with self.assertRaises(trammel.TrammelError):
            self.model.predict(joints.assign(tool_id="no-such-tool"))
        with self.assertRaisesRegex(trammel.Usage, "column tool_id says 'other'"):
            self.model.predict(joints.assign(tool_id="other"), tool="spindle")
        with self.assertRaisesRegex(trammel.Usage, "corrected already"):
            self.model.correct(self.model.correct(targets).frame())

    def test_numbers_that_would_be_cut_are_refused(self):
        joints = np.array([[10.0, -30, 40, 0, 30, 0]])
        pose = self.model.predict(joints).nominal
        for wrong in (2**32, 1.9, True, float("nan"), "0", [0.5]):
            with self.assertRaises(trammel.TrammelError, msg=repr(wrong)):
                self.model.correct(pose, conf=wrong)
        self.assertEqual(len(self.model.correct(pose, conf=2.0)), 1)
        for wrong in (joints + 1j, np.ma.masked_less(joints, 0)):
            with self.assertRaises(trammel.Usage):
                self.model.predict(wrong)


    def test_a_share_that_is_none_and_numbers_that_are_masked_are_refused(self):
        for share in (-0.1, 1.0, 2.0, float("nan")):
            with self.assertRaisesRegex(trammel.Usage, "validation_share"):
                trammel.train(self.cell, self.batch, level="M1", bias="none", validation_share=share)
        with self.assertRaisesRegex(trammel.Usage, "position_mm: some values are masked"):
            trammel.Batch.from_arrays(np.zeros((2, 6)), np.ma.masked_array(np.ones((2, 3)), mask=np.eye(2, 3)))

    def test_the_frame_of_a_batch_is_the_same_whatever_its_file_looks_like(self):
        try:
            import pandas
        except ImportError:
            self.skipTest("no pandas here")
        text = self.batch.csv()
        plain = trammel.Batch.parse(text, "plain").frame()
        self.assertEqual(len(plain), 40)
        head, rest = text[:text.index("\n")], text[text.index("\n"):]
        for odd in (text.replace(",", ";").replace(".", ","), text.replace(",", "\t"), head.upper() + rest, "sep=;\n" + text.replace(",", ";")):
            pandas.testing.assert_frame_equal(trammel.Batch.parse(odd, "odd").frame(), plain)
        named = trammel.Batch.parse(text.replace("\n1,", "\np#1,"), "named").frame()
        self.assertEqual(named["pose_id"][0], "p#1")
        np.testing.assert_array_equal(named["x_mm"], plain["x_mm"])


class Threads(unittest.TestCase):
    """Long work leaves the interpreter to others."""

    def test_others_run_while_a_model_predicts(self):
        cell = trammel.Cell.load(CELL)
        planned = trammel.plan(cell, 100)
        model = trammel.train(cell, trammel.simulate(cell, TRUTH, planned), level="M2", bias="se")
        joints = np.tile(planned.joints_deg, (100, 1))
        started, ended = threading.Event(), threading.Event()

        def work():
            started.set()
            model.predict(joints)
            ended.set()

        interval = sys.getswitchinterval()
        sys.setswitchinterval(1000)  # nobody else runs unless the interpreter's lock is given back
        self.addCleanup(sys.setswitchinterval, interval)
        worker = threading.Thread(target=work)
        worker.start()
        started.wait()
        seen = ended.is_set()
        worker.join()
        self.assertFalse(seen)

    def test_others_go_on_while_a_model_is_trained_and_tells_of_it(self):
        cell = trammel.Cell.load(CELL)
        batch = trammel.simulate(cell, TRUTH, trammel.plan(cell, 100))
        started, ended = threading.Event(), threading.Event()

        def work():
            started.set()
            trammel.train(cell, batch, level="M3", bias="se", progress=lambda stage, share: None)
            ended.set()

        interval = sys.getswitchinterval()
        sys.setswitchinterval(1000)  # nobody else runs unless the interpreter's lock is given back
        self.addCleanup(sys.setswitchinterval, interval)
        worker = threading.Thread(target=work)
        worker.start()
        started.wait()
        steps = 0
        while not ended.wait(0.001):
            steps += 1
        worker.join()
        self.assertGreater(steps, 10)

    def test_what_the_listener_raises_ends_the_training(self):
        cell = trammel.Cell.load(CELL)
        batch = trammel.simulate(cell, TRUTH, trammel.plan(cell, 40))
        told = []

        def listener(stage, share):
            told.append(stage)
            raise LookupError("enough")

        with self.assertRaisesRegex(LookupError, "enough"):
            trammel.train(cell, batch, progress=listener)
        self.assertEqual(len(told), 1)

    def test_control_c_ends_the_training(self):
        cell = trammel.Cell.load(CELL)
        batch = trammel.simulate(cell, TRUTH, trammel.plan(cell, 40))
        with self.assertRaises(KeyboardInterrupt):
            trammel.train(cell, batch, progress=lambda stage, share: os.kill(os.getpid(), signal.SIGINT))


def reserved(case, kind, count):
    """A number that no other test has while this one lives (as tests/support/own_ports.cpp has it)."""
    for tried in range(count):
        number = (os.getpid() + tried) % count
        held = socket.socket(socket.AF_UNIX)
        try:
            held.bind(f"\0trammel-test-{kind}-{number + (kind == 'domain')}")
        except OSError:
            held.close()
            continue
        case.addClassCleanup(held.close)
        return number
    raise RuntimeError(f"no {kind} is left for this test")


def own_ports(case):
    """The first of eight ports."""
    return 20000 + 8 * reserved(case, "ports", 1500)


class Service(unittest.TestCase):
    """A session asks a daemon of its own."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        port = own_ports(cls)
        domain = 1 + reserved(cls, "domain", 48)
        text = CELL.read_text().replace("../models", str(SOURCE / "models")).replace("bias: auto", "bias: none")
        (cls.folder / "cell-7.yaml").write_text(text)
        config = cls.folder / "server.yaml"
        config.write_text(f"version: 1\nserver: python-{port}\ncells: [cell-7.yaml]\nstore: trammel.db\n")
        cls.daemon = subprocess.Popen([BUILD / "server/trammeld", "--config", config, "--port", str(port), "--domain", str(domain)],
                                      stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        cls.addClassCleanup(cls.end)
        cls.where = dict(domain=domain, hosts=[f"127.0.0.1:{port}"])
        cls.session = trammel.Session(domain=domain, ports=[port], timeout_s=30)
        cls.cell = trammel.Cell.load(CELL)
        cls.planned = trammel.plan(cls.cell, 60)
        job = cls.session.submit("cell-7", trammel.simulate(cls.cell, TRUTH, cls.planned))
        cls.ended = cls.session.wait_for(job, limit_s=300)

    @classmethod
    def end(cls):
        cls.daemon.terminate()
        cls.daemon.wait()

    def test_says_what_is_there(self):
        self.assertEqual(self.session.status()[0]["cells"], ["cell-7"])
        self.assertTrue(self.ended["in_force"], self.ended)
        self.assertIn(self.ended["id"], [job["id"] for job in self.session.jobs("cell-7")])
        self.assertTrue(self.session.models()[0]["in_force"])

    def test_batches_audit_and_jobs_are_read_and_cancelled(self):
        batches = self.session.batches("cell-7")
        self.assertEqual(batches[0]["poses"], 60)
        self.assertEqual(batches[0]["kept_out"], "")
        again = self.session.export_batch("cell-7", batches[0]["id"])
        self.assertEqual(len(again), 60)
        trail = self.session.audit("cell-7")
        self.assertIn("batch", {row["what"] for row in trail[0]["rows"]}, trail[0])
        with self.assertRaises(trammel.TrammelError):
            self.session.cancel(self.ended["id"])
        with self.assertRaises(trammel.Usage):
            trammel.Session(discovery_servers="no such host:x")

    def test_what_is_no_session_and_no_list_of_joints_is_refused(self):
        for wrong in (dict(domain=233), dict(timeout_s=float("inf")), dict(timeout_s=float("nan")), dict(timeout_s=0)):
            with self.assertRaises(trammel.Usage, msg=repr(wrong)):
                trammel.Session(**wrong)
        joints = self.planned.joints_deg[:2]
        for wrong in (joints.T, joints.reshape(-1), joints[:1].T):
            with self.assertRaises(trammel.TrammelError):
                self.session.predict("cell-7", wrong)
        self.assertEqual(len(self.session.predict("cell-7", joints[0])), 1)

    def test_answers_as_its_model_does_offline(self):
        model = trammel.Model.parse(self.session.export_model("cell-7"))
        joints = self.planned.joints_deg[:20]
        here, there = model.predict(joints), self.session.predict("cell-7", joints)
        for field in ("error_mm", "stddev_mm", "true_stddev_mm", "covariance_mm2", "rotation_deg", "predicted"):
            np.testing.assert_allclose(getattr(there, field), getattr(here, field), atol=1e-9, err_msg=field)
        here, there = model.correct(joints_deg=joints), self.session.correct("cell-7", joints_deg=joints)
        self.assertEqual(there.status, here.status)
        np.testing.assert_allclose(there.joints_deg, here.joints_deg, atol=1e-9)
        np.testing.assert_allclose(there.turn_after_deg, here.turn_after_deg, atol=1e-9)

    def test_a_session_is_answered_however_its_hosts_clock_is_set(self):
        clock = self.folder / "clock"
        clock.write_bytes(bytes(8))
        program = """
import struct, sys, trammel
options = dict(domain=int(sys.argv[2]), hosts=[sys.argv[3]], timeout_s=20)
session = trammel.Session(**options)
for years in (0, -100, 140, 0):
    with open(sys.argv[1], "r+b") as clock:
        clock.write(struct.pack("q", years * 365 * 24 * 3600))
    for _ in range(5):
        session.models("cell-7")
    trammel.Session(**options).models("cell-7")  # somebody new
print("answered")
"""
        moved = {**os.environ, "LD_PRELOAD": str(BUILD / "tests/libtrammel_moved_clock.so"), "TRAMMEL_TEST_CLOCK": str(clock)}
        done = subprocess.run([sys.executable, "-c", program, clock, str(self.where["domain"]), *self.where["hosts"]], env=moved,
                              capture_output=True, text=True, timeout=100)
        self.assertEqual((done.stdout, done.stderr), ("answered\n", ""))

    def test_servers_are_found_by_host_and_port(self):
        session = trammel.Session(**self.where, timeout_s=30)
        self.assertEqual(session.status()[0]["cells"], ["cell-7"])
        for wrong in (dict(hosts=["127.0.0.1:99"]), dict(hosts=["no.such.host.invalid"])):
            with self.assertRaises(trammel.Usage) as raised:
                trammel.Session(**wrong)
            self.assertEqual(raised.exception.column, "hosts")
        with self.assertRaisesRegex(trammel.TrammelError, "/nowhere"):
            trammel.Session(**self.where, security="/nowhere")

    def test_a_robot_is_checked_and_diagnosed_by_a_batch_that_is_not_kept(self):
        few = trammel.simulate(self.cell, TRUTH, trammel.plan(self.cell, 12, criterion="check"), seed=5)
        told = self.session.check("cell-7", few)
        self.assertIn(told["verdict"], ("healthy", "cannot_tell"), told)
        self.assertEqual(self.session.check("cell-7", few, tolerance_mm=2.5)["tolerance_mm"], 2.5)
        self.assertEqual(self.session.diagnose("cell-7")["poses"], 60)
        with self.assertRaises(trammel.TrammelError) as raised:
            self.session.check("cell-7", "no such batch")
        self.assertIn("no such batch", str(raised.exception))

    def test_a_model_of_a_file_becomes_a_version(self):
        model = trammel.train(self.cell, trammel.simulate(self.cell, TRUTH, self.planned, seed=9), bias="none")
        version = self.session.import_model("cell-7", model)
        kept = {one["version"]: one["hash"] for one in self.session.models("cell-7")}
        self.assertEqual(kept[version], model.facts["hash"])
        with self.assertRaisesRegex(trammel.Usage, "a Model"):
            self.session.import_model("cell-7", "cell.model")

    def test_what_is_worse_than_the_model_in_force_is_activated_by_force_only(self):
        present = self.session.models()[0]["version"]
        worse = trammel.train(self.cell, trammel.simulate(self.cell, TRUTH, self.planned, seed=9), level="M1", bias="none")
        version = self.session.import_model("cell-7", worse)
        with self.assertRaisesRegex(trammel.Refused, "worse than version") as raised:
            self.session.activate("cell-7", version)
        at_the_command_line = subprocess.run(
            [BUILD / "clients/trammel", "activate", "--host", self.where["hosts"][0], "--domain", str(self.where["domain"]),
             "--model", f"cell-7@{version}"], capture_output=True, text=True)
        self.assertEqual(at_the_command_line.returncode, 3, at_the_command_line.stderr)
        self.assertIn(raised.exception.message, at_the_command_line.stderr)
        self.assertEqual(self.session.models()[0]["version"], present)
        self.assertEqual(self.session.activate("cell-7", version, force=True), version)
        self.assertEqual(self.session.models()[0]["version"], version)
        self.assertEqual(self.session.activate("cell-7", present), present)

    def test_what_is_said_of_a_batch_holds_for_the_version_that_it_was_decided_against_only(self):
        again = trammel.Batch.parse(trammel.simulate(self.cell, TRUTH, self.planned, seed=12).csv(), "again")
        self.session.wait_for(self.session.submit("cell-7", again), limit_s=300)
        present = next(one["version"] for one in self.session.models("cell-7") if one["in_force"])
        for change in (self.session.discard, self.session.release):
            with self.assertRaises(trammel.Conflict) as raised:
                change("cell-7", "again", expected_version=present + 1)
            self.assertIn(f"version {present}", raised.exception.message)
        with self.assertRaises(trammel.TrammelError) as raised:
            self.session.release("cell-7", "again", expected_version=present)
        self.assertIn("quarantine", raised.exception.message)
        self.session.discard("cell-7", "again", reason="measured twice", expected_version=present)
        with self.assertRaises(trammel.Conflict) as raised:
            self.session.release("cell-7", "again", expected_version=present)
        self.assertIn("discarded", raised.exception.message)

    def test_a_batch_that_is_stored_is_learned_from_again(self):
        ended = self.session.wait_for(self.session.retrain("cell-7", level="M2"), limit_s=300)
        self.assertEqual(ended["stage"], "done", ended)
        self.assertEqual({one["version"]: one["level"] for one in self.session.models("cell-7")}[ended["version"]], "base,geometry")

    def test_control_c_ends_the_waiting(self):
        many = trammel.simulate(self.cell, TRUTH, trammel.plan(self.cell, 1000), seed=11)
        many = trammel.Batch.parse(many.csv(), "many")
        self.session.wait_for(self.session.submit("cell-7", many), limit_s=300)
        job = self.session.retrain("cell-7", bias="auto")  # takes some seconds
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            self.session.wait_for(job, limit_s=300)
        stages = {one["id"]: one["stage"] for one in self.session.jobs("cell-7")}
        self.assertNotIn(stages[job], ("done", "failed"))
        self.session.wait_for(job, limit_s=300)

    def test_refuses_with_the_servers_reason(self):
        with self.assertRaises(trammel.NotFound):
            self.session.predict("cell-8", np.zeros(6))
        with self.assertRaises(trammel.TrammelError) as raised:
            self.session.activate("cell-7", 99)
        self.assertIn(raised.exception.code, ("not_found", "refused"))


class Guards(unittest.TestCase):
    """A batch that nothing should be learned from gets the same words at each door: command line, Python, service."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        port = own_ports(cls)
        domain = 1 + reserved(cls, "domain", 48)
        cls.path = cls.folder / "cell-7.yaml"
        cls.path.write_text(CELL.read_text().replace("../models", str(SOURCE / "models")).replace("bias: auto", "bias: none"))
        config = cls.folder / "server.yaml"
        config.write_text(f"version: 1\nserver: guards-{port}\ncells: [cell-7.yaml]\nstore: trammel.db\n")
        cls.daemon = subprocess.Popen([BUILD / "server/trammeld", "--config", config, "--port", str(port), "--domain", str(domain)],
                                      stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        cls.addClassCleanup(cls.end)
        cls.session = trammel.Session(domain=domain, ports=[port], timeout_s=30)
        cls.cell = trammel.Cell.load(cls.path)
        good = trammel.simulate(cls.cell, TRUTH, trammel.plan(cls.cell, 60, seed=3), seed=3).csv()
        cls.good = list(csv.DictReader(io.StringIO(good)))

    @classmethod
    def end(cls):
        cls.daemon.terminate()
        cls.daemon.wait()

    def batch(self, name, mistake):
        """The good batch with a mistake in each row; `mistake(i, row)` returns the columns that it changes."""
        rows = [{**row, **{key: repr(float(value)) for key, value in mistake(i, row).items()}} for i, row in enumerate(self.good)]
        text = io.StringIO()
        writer = csv.DictWriter(text, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        path = self.folder / f"{name}.csv"
        path.write_text(text.getvalue())
        return path, trammel.Batch.parse(text.getvalue(), name)

    @staticmethod
    def run_program(*command):
        """Exit code, and all that it said."""
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    def at_the_command_line(self, path, *options, cell=None):
        return self.run_program(BUILD / "clients/trammel", "train", "--cell", cell or self.path, "--batch", path, "-o",
                                self.folder / "m.model", "--json", self.folder / "m.json", *options)

    def applied_at_the_command_line(self, path):
        return self.run_program(BUILD / "clients/trammel", "diagnose", "--cell", self.path, "--batch", path, "--apply", "--cell-out",
                                self.folder / "extended.yaml", "--model", self.folder / "extended.model")

    def at_the_library(self, what, path):
        return self.run_program(BUILD / "tests/trammel_library_door", what, self.path, path)

    def words_of_the_service(self, batch):
        """Why it learns nothing from the batch: it is refused when it is handed in, or kept in quarantine."""
        try:
            ended = self.session.wait_for(self.session.submit("cell-7", batch), limit_s=300)
        except trammel.Refused as refused:
            return refused.message
        self.assertEqual(ended["verdict"], "quarantined", ended)
        return ended["what"]

    def bad_batches(self):
        """Each as a file and as a batch, by name."""
        later = len(self.good) // 2
        following = lambda i: self.good[(i + 1) % len(self.good)]

        def longer_tool(i, row):  # 30 mm along its own axis
            w, x, y, z = (float(row[name]) for name in ("qw", "qx", "qy", "qz"))
            axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z])
            return {name: float(row[name]) + 30 * along for name, along in zip(("x_mm", "y_mm", "z_mm"), axis)}

        mistakes = {
            "mirrored": lambda i, row: {"y_mm": -float(row["y_mm"])},
            "exchanged": lambda i, row: {"x_mm": row["z_mm"], "z_mm": row["x_mm"]},
            "metres": lambda i, row: {axis: float(row[axis]) / 1000 for axis in ("x_mm", "y_mm", "z_mm")},
            "inches": lambda i, row: {axis: float(row[axis]) / 25.4 for axis in ("x_mm", "y_mm", "z_mm")},
            "shifted": lambda i, row: {axis: following(i)[axis] for axis in ("x_mm", "y_mm", "z_mm")},
            "sign": lambda i, row: {"q3_deg": -float(row["q3_deg"])},
            "joints": lambda i, row: {"q4_deg": row["q5_deg"], "q5_deg": row["q4_deg"]},
            "zero-2": lambda i, row: {"q2_deg": float(row["q2_deg"]) + (0.2 if i >= later else 0)},
            "zero-3": lambda i, row: {"q3_deg": float(row["q3_deg"]) + (0.2 if i >= later else 0)},
            "tool": longer_tool,
            "one-row": lambda i, row: {axis: float(row[axis]) / (1000 if i == 17 else 1) for axis in ("x_mm", "y_mm", "z_mm")},
        }
        return {name: self.batch(name, mistake) for name, mistake in mistakes.items()}

    def test_a_batch_that_is_refused_is_refused_at_every_door_in_the_same_words(self):
        for name, (path, batch) in self.bad_batches().items():
            with self.subTest(name):
                with self.assertRaises(trammel.Refused) as raised:
                    trammel.train(self.cell, batch)
                words = raised.exception.message
                self.assertEqual(raised.exception.code, "refused")
                for code, said in (self.at_the_command_line(path), self.at_the_library("train", path)):
                    self.assertEqual(code, 3, said)
                    self.assertIn(words, said)
                self.assertIn(words, self.words_of_the_service(batch))

    def test_what_changed_in_a_batch_that_somebody_has_looked_at_is_told_with_the_model_at_every_door(self):
        path, batch = self.bad_batches()["zero-2"]
        code, said = self.at_the_command_line(path, "--as-read")
        self.assertEqual(code, 0, said)
        notes = json.loads((self.folder / "m.json").read_text())["notes"]
        changed = [note for note in notes if note["code"] == "changed_within_batch"]
        self.assertEqual([note["severity"] for note in changed], ["warning"], notes)
        self.assertIn("lost zero in joint 2", changed[0]["text"])
        self.assertIn(changed[0]["text"], said)
        self.assertEqual(trammel.train(self.cell, batch, as_read=True).notes, notes)

    def test_a_cell_that_counts_on_its_twins_gets_them_at_every_door_or_is_refused(self):
        batch = trammel.Batch.parse(self.batch("twin", lambda i, row: {})[0].read_text(), "twin")
        twins = [trammel.train(self.cell, trammel.simulate(self.cell, TRUTH, trammel.plan(self.cell, 60, seed=seed), seed=seed))
                 for seed in (11, 12, 13)]
        among = self.folder / "among-twins.yaml"
        among.write_text(self.path.read_text() + "prior: fleet\n")
        cell = trammel.Cell.load(among)
        with self.assertRaises(trammel.Usage) as raised:
            trammel.train(cell, batch)
        self.assertIn("no robot of its type is named", raised.exception.message)
        code, said = self.at_the_command_line(self.folder / "twin.csv", cell=among)
        self.assertEqual(code, 2, said)
        self.assertIn(raised.exception.message, said)
        named = []
        for k, twin in enumerate(twins):
            twin.save(self.folder / f"twin-{k}.model")
            named += ["--fleet", self.folder / f"twin-{k}.model"]
        code, said = self.at_the_command_line(self.folder / "twin.csv", *named, cell=among)
        self.assertEqual(code, 0, said)
        drawn, alone = trammel.train(cell, batch, fleet=twins), trammel.train(self.cell, batch)
        told = json.loads((self.folder / "m.json").read_text())
        self.assertEqual(drawn.notes, told["notes"])
        values = [parameter["value"] for parameter in drawn.parameters]
        trained = trammel.Model.load(self.folder / "m.model")
        np.testing.assert_allclose(values, [parameter["value"] for parameter in trained.parameters], rtol=1e-9, atol=1e-12)
        self.assertNotEqual(values, [parameter["value"] for parameter in alone.parameters])

    def test_what_a_diagnosis_tells_is_the_same_at_every_door(self):
        path, batch = self.bad_batches()["zero-2"]
        file = self.folder / "found.json"
        code, said = self.run_program(BUILD / "clients/trammel", "diagnose", "--cell", self.path, "--batch", path, "--json", file)
        self.assertEqual(code, 0, said)
        told = json.loads(file.read_text())
        for found in (trammel.diagnose(self.cell, batch), self.session.diagnose("cell-7", batch, limit_s=300)):
            self.assertEqual({**found, "batch": ""}, {**told, "batch": ""})

    def test_what_such_a_batch_shows_is_applied_at_every_door_or_at_none(self):
        ends = set()
        for name, (path, batch) in self.bad_batches().items():
            with self.subTest(name):
                try:
                    extension = trammel.extend(self.cell, batch)
                    code, words = 0 if extension.model else 1, extension.why_not
                except trammel.Refused as refused:
                    code, words = 3, refused.message
                ends.add(code)
                for at_door, said in (self.applied_at_the_command_line(path), self.at_the_library("extend", path)):
                    self.assertEqual(at_door, code, said)
                    self.assertIn(words, said)
                try:
                    ended = self.session.extend("cell-7", batch, limit_s=300)
                except trammel.Refused as refused:
                    ended = {"stage": "failed", "what": refused.message, "in_force": False}
                self.assertEqual((ended["stage"] == "failed", ended["in_force"]), (code == 3, code == 0), ended)
                self.assertIn(words, ended["what"])
        self.assertEqual(ends, {1, 3}, "some are refused, and what the others show is not applied")

    def test_a_model_that_leaves_hundreds_of_sigma_waits_for_a_person_at_every_door(self):
        def bent(i, row):  # as no cause bends it
            q = [np.radians(float(row[f"q{joint}_deg"])) for joint in (1, 2, 3)]
            bends = {"x_mm": np.sin(7 * q[1]), "y_mm": np.cos(6 * q[2]), "z_mm": np.sin(8 * q[0])}
            return {axis: float(row[axis]) + 2 * bend for axis, bend in bends.items()}
        path, batch = self.batch("bent", bent)
        code, said = self.at_the_command_line(path)
        self.assertEqual(code, 0, said)
        notes = json.loads((self.folder / "m.json").read_text())["notes"]
        self.assertEqual((notes[0]["code"], notes[0]["severity"]), ("left_over_sigma", "stop"))
        self.assertEqual(notes[-1]["code"], "robot_not_confirmed")
        self.assertEqual(trammel.train(self.cell, batch).notes, notes)
        ended = self.session.wait_for(self.session.submit("cell-7", batch), limit_s=300)
        self.assertEqual((ended["verdict"], ended["in_force"]), ("undecided", False), ended)
        self.assertEqual(ended["held_back"], "stop_note")
        made = trammel.Model.parse(self.session.export_model("cell-7", ended["version"]))
        self.assertIn(made.notes[0]["text"], ended["what"])


class Documents(unittest.TestCase):
    """What is written is true."""

    def test_everything_says_what_it_is(self):
        for name in trammel.__all__:
            thing = getattr(trammel, name)
            self.assertTrue(inspect.getdoc(thing), name)
            for member, value in vars(thing).items() if inspect.isclass(thing) else ():
                if not member.startswith("_") and (callable(value) or isinstance(value, (property, staticmethod))):
                    self.assertTrue(inspect.getdoc(value), f"{name}.{member}")

    def test_docstrings_say_the_shapes_of_arrays(self):
        for holder, names in ((trammel.Model, ("predict", "correct", "parameter_covariance")), (trammel.Batch, ("from_arrays",)),
                              (trammel.Session, ("predict", "correct"))):
            for name in names:
                self.assertRegex(inspect.getdoc(getattr(holder, name)), r"\((N|P), ", f"{holder.__name__}.{name}")

    def test_the_tour_prints_what_its_comments_say(self):
        script = SOURCE / "clients/python/examples/tour.py"
        said = [line[3:] for line in script.read_text().splitlines() if line.startswith("#> ")]
        done = subprocess.run([sys.executable, script, SOURCE], capture_output=True, text=True)
        self.assertEqual(done.stderr, "")
        self.assertEqual(done.stdout.splitlines(), said)

    def test_the_notebook_goes_from_a_batch_to_a_corrected_program_with_its_plots(self):
        script = SOURCE / "clients/python/examples/notebook.py"
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder)
            done = subprocess.run([sys.executable, script, SOURCE, out], capture_output=True, text=True)
            self.assertEqual(done.stderr, "")
            self.assertIn("10 of 10 targets corrected", done.stdout)
            self.assertIn("drill.mod: all targets corrected", done.stdout)
            self.assertRegex(done.stdout, r"mm nominal, 0\.0\d mm compensated")
            for plot in ("residuals.svg", "targets.svg"):
                self.assertGreaterEqual((out / plot).read_text().count("<circle"), 20, plot)
            self.assertIn("Good to ", (out / "model.html").read_text())
            before, after = (SOURCE / "config/programs/drill.mod").read_bytes(), (out / "program/drill.mod").read_bytes()
            self.assertNotEqual(before, after)
            self.assertIn(b"MODULE", after)

    def test_what_dir_lists_is_what_is_meant_for_users(self):
        self.assertEqual(sorted(trammel.__all__), dir(trammel))
        self.assertRegex(trammel.__version__, r"^\d+\.\d+\.\d+$")

    def test_stubs_fit_the_module_and_types_fit_the_stubs(self):
        package = pathlib.Path(trammel.__file__).parent
        mypy = ["-m", "mypy", "--strict", "--cache-dir", str(BUILD / "mypy"), "--ignore-missing-imports"]
        done = subprocess.run([sys.executable, *mypy, "-p", "trammel"], capture_output=True, text=True, cwd=package.parent)
        if "No module named mypy" in done.stderr:
            self.skipTest("no mypy here")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        for script in ("tour.py", "notebook.py"):
            done = subprocess.run([sys.executable, *mypy, str(SOURCE / "clients/python/examples" / script)], capture_output=True, text=True,
                                  cwd=package.parent)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        allowed = pathlib.Path(__file__).with_name("stubtest_allowed.txt")
        done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "trammel._trammel", "--ignore-missing-stub",
                               "--allowlist", str(allowed)], capture_output=True, text=True, cwd=package.parent)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
