// The one place where the words of refusals are looked at, as whoever reads them gets them: by way
// of the real readers and checks. Everywhere else tests ask the data.
#include <gtest/gtest.h>

#include "server/base/json_guard.h"
#include "server/base/text_file.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/calibrate/calibrate.h"
#include "server/config/server_config.h"
#include "server/error_sources/error_source.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/measurement.h"
#include "server/store/store_check.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

TEST(Sentence, HasFileRowClauseAndWhatToDo) {
  const Failure found = refused("joint 3 is 241.2 deg, limit 70 deg")
                            .in("lt-07.csv")
                            .at_row(12)
                            .next("teach it again");
  EXPECT_EQ(sentence(found.value()),
            "lt-07.csv row 12: joint 3 is 241.2 deg, limit 70 deg; teach it again");
  EXPECT_EQ(sentence(refused("no rows").value()), "no rows");
  EXPECT_EQ(sentence(refused("no rows").in("b.csv").value()), "b.csv: no rows");
}

TEST(Sentence, WhatIsKnownFurtherInsideStays) {
  const Error error = refused("expected a number")
                          .under("mass_kg")
                          .in("robot.yaml")
                          .at_row(7)
                          .under("joints 2")
                          .in("cell.yaml")
                          .at_row(1)
                          .next("look")
                          .next("elsewhere")
                          .value();
  EXPECT_EQ(sentence(error), "robot.yaml row 7: joints 2: mass_kg: expected a number; look");
  EXPECT_EQ(error.field, "joints 2: mass_kg");
}

TEST(Sentence, OfSeveralProblemsHasALineEach) {
  const Error all =
      together({refused("a").in("x.yaml").value(), refused("b").in("y.yaml").at_row(3).value()});
  EXPECT_EQ(sentence(all), "x.yaml: a\ny.yaml row 3: b");
  ASSERT_EQ(apart(all).size(), 2u);
  EXPECT_EQ(sentence(apart(all)[0]), "x.yaml: a");
}

template <typename T>
std::string said(const Result<T>& result) {
  return result ? "nothing is refused" : sentence(result.error());
}

std::string of_batch(const std::string& text) { return said(parse_batch(text, "lt-07.csv")); }

TEST(Sentence, OfBatches) {
  const std::string header = "q1_deg,x_mm,y_mm,z_mm\n";
  EXPECT_EQ(of_batch(""),
            "lt-07.csv: empty file, expected a header line with column names; trammel help formats "
            "says which columns");
  EXPECT_EQ(of_batch(header), "lt-07.csv: no measurements below the header, at least 1 is needed");
  EXPECT_EQ(of_batch("q1_deg,x_mm,y_mm\n1,2,3\n"),
            "lt-07.csv: missing column z_mm; the header has: q1_deg,x_mm,y_mm; trammel help "
            "formats tells them all");
  EXPECT_EQ(of_batch(header + "1,2,3\n"),
            "lt-07.csv row 2: 3 values, the header has 4 columns; a value that is not known stays "
            "empty between its separators");
  EXPECT_EQ(of_batch(header + "1,2,3,4\n1,1.5mm,3,4\n"),
            "lt-07.csv row 3: x_mm is '1.5mm', expected a number; write it with digits alone: the "
            "unit stands in the column's name");
  EXPECT_EQ(of_batch(header + "nan,2,3,4\n"),
            "lt-07.csv row 2: q1_deg is nan, expected a finite number");
  EXPECT_EQ(of_batch(header + "1,2,3e7,4\n"),
            "lt-07.csv row 2: y_mm is 3e+07, limit 1e+06; are its values in another unit? The "
            "column's name says in which they are");
  EXPECT_EQ(of_batch("q1_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz\n1,2,3,4,1,0,0,0.1\n"),
            "lt-07.csv row 2: quaternion qw,qx,qy,qz has length 1.00499, expected 1 (limit 0.001)");
  EXPECT_EQ(of_batch("q1_deg,x_mm,y_mm,z_mm,qw\n1,2,3,4,1\n"),
            "lt-07.csv: missing column qx; qw, qx, qy, qz come all together or not at all");
  EXPECT_EQ(of_batch("Main p1 1 2 3\n"),
            "lt-07.csv: measured points without the joints that were commanded; join them with the "
            "plan by pose_id first: trammel convert --points POINTS --joints PLAN -o BATCH");
  EXPECT_EQ(of_batch("J1,X,Y,Z\n1,2,c,4\n"),
            "lt-07.csv row 2: Y is 'c', expected a number; write it with digits alone: the unit "
            "stands in the column's name");
}

TEST(Sentence, OfWhatTheCellDoesNotTake) {
  const auto cell = test::cell_7();
  MeasurementBatch batch;
  batch.id = "lt-07";
  EXPECT_EQ(said(check_against_cell(batch, *cell)),
            "batch lt-07: no measurements, at least 1 is needed");
  Measurement m;
  m.row = 12;
  m.context.q = JointVector::Zero(6);
  m.context.q(2) = 4.21;
  batch.measurements = {m};
  EXPECT_EQ(
      said(check_against_cell(batch, *cell)),
      "batch lt-07 row 12: joint 3 is 241.215 deg, limit 70 deg; is the joint told in this "
      "unit, and with the sign and the zero of the robot file? Else the limit in that file is "
      "another one");
  batch.measurements[0].context.q(2) = 0;
  batch.measurements[0].context.tool = "saw";
  EXPECT_EQ(said(check_against_cell(batch, *cell)),
            "batch lt-07 row 12: cell cell-7: unknown tool 'saw'; known: spindle");
}

TEST(Sentence, OfCellAndServerFiles) {
  const test::TemporaryFolder folder;
  folder.write("robot.yaml", test::small_robot_yaml());
  const std::string cell =
      folder.write("cell.yaml", "version: 1\ncell: a b\nrobot: robot.yaml\ntools: {t: null}\n");
  EXPECT_EQ(said(read_cell(cell)),
            cell + " row 2: cell: 'a b', expected a name without blanks, '@' and '/'");
  const std::string lost =
      folder.write("lost.yaml", "version: 1\ncell: a\nrobot: no.yaml\ntools: {t: null}\n");
  EXPECT_EQ(said(read_cell(lost)),
            folder.file("no.yaml") + ": no such file; " + lost + " names it as its robot");
  folder.write("cell-7.yaml", test::small_cell_yaml("cell-7"));
  const std::string start = "version: 1\nserver: a\ncells: [cell-7.yaml]\nstore: t.db\n";
  const std::string server =
      folder.write("server.yaml", start + "dds: {prot: 17500}\nlog: {level: loud}\n");
  EXPECT_EQ(
      said(read_server_config(server)),
      server +
          " row 5: dds: prot: unknown key, did you mean port?; known here: domain address "
          "allow_network without_security security port discovery_servers compute_workers "
          "max_clients client_requests client_mb queued_requests queued_mb cell_share ros2\n" +
          server + " row 6: log: level: 'loud', expected debug, info, warn, error");
  folder.write("server.yaml", start + "dds: {port: 80}\n");
  EXPECT_EQ(said(read_server_config(server)),
            server + " row 5: dds: port: 80, limit 1024 to 65535");
}

TEST(Sentence, OfFilesThatCannotBeReadOrWritten) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(said(read_text_file("/nowhere/b.csv")), "/nowhere/b.csv: no such file");
  const std::string large = folder.write("large", "12345");
  EXPECT_EQ(said(read_text_file(large, 4)), large + ": 5 bytes, limit 4");
  const std::string path = folder.file("no/such/a.txt");
  EXPECT_EQ(said(write_text_file(path, "x")),
            path +
                ": cannot be written: No such file or directory; make the folder first: mkdir -p " +
                folder.file("no/such"));
  EXPECT_EQ(check_writable(folder.file("")).error().next, "name a file in it");
  const std::string store = folder.file("nowhere/t.db");
  EXPECT_EQ(said(check_store(store)), store + ": its folder " + folder.file("nowhere") +
                                          " is not there; create it, or name another");
  EXPECT_EQ(said(check_json_limits("]", "x.json", {})),
            "x.json: not JSON: byte 0 closes what was not opened");
}

TEST(Sentence, OfModelsThatAreSpelledWrong) {
  EXPECT_EQ(said(make_error_source("complience", *test::cell_7())).substr(0, 82),
            "unknown error source 'complience', did you mean compliance?; levels are M0 to M3, ");
  EXPECT_EQ(said(check_bias_spelling("se +")),
            "bias kernel `se +`, character 5: a kernel is expected");
  EXPECT_EQ(said(check_bias_spelling("rbf")).substr(0, 64),
            "bias kernel `rbf`: `rbf` is unknown; known are none and auto (al");
  EXPECT_EQ(
      said(calibrate(CalibrationProblem{make_physical_model(test::cell_7(), {"base"}).value(), {}},
                     CalibrateOptions{})),
      "batch : no measurements to calibrate with");
  const auto cell = test::cell_7();
  const CalibrationProblem without_sides{
      make_physical_model(cell, {"backlash:2"}).value(),
      parse_batch(test::small_batch_csv(*cell, {}), "b.csv").value()};
  EXPECT_EQ(said(calibrate(without_sides, CalibrateOptions{})),
            "batch b: backlash in joint 2 needs an approach direction (dir2), which no pose has");
}

}  // namespace
}  // namespace trammel
