#include "server/report/model_page.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>

#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/measurement/checked_batch.h"
#include "server/report/model_poses.h"
#include "server/report/model_promise.h"
#include "server/report/model_scene.h"
#include "server/tasks/train/train.h"
#include "tests/report/seen_by_browser.h"
#include "tests/support/from_rows.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

class ModelPage : public testing::Test {
 protected:
  ModelPage() : cell_(test::small_cell("cell-3", "se")) {
    test::SmallBatch shape;
    shape.poses = 30;
    batch_ = parse_batch_csv(test::small_batch_csv(*cell_, shape), "lt-<03>.csv").value();
  }
  CompensatedModel trained(const std::string& bias, double validation_share = 0) const {
    TrainOptions options;
    options.bias = bias;
    const CheckedBatch checked =
        check_against_cell(batch_, *cell_, drawn(validation_share, 1)).value();
    return train(cell_, checked, options).value();
  }
  /// The data that the charts of the page are drawn from.
  static nlohmann::json chart_data(const std::string& page) {
    const std::string opening = "<script type=\"application/json\" id=\"data\">";
    const std::size_t from = page.find(opening) + opening.size();
    return nlohmann::json::parse(page.substr(from, page.find("</script>", from) - from));
  }
  static bool has(const std::string& page, const std::string& part) {
    return page.find(part) != std::string::npos;
  }

  std::shared_ptr<const Cell> cell_;
  MeasurementBatch batch_;
};

TEST_F(ModelPage, ShowsWhereTheModelComesFromAndItsParameters) {
  const CompensatedModel model = trained("none");
  const std::string page = model_page(model, std::nullopt);
  for (const std::string& part :
       {model.provenance().hash, model.provenance().batch_hash, cell_->robot.name(),
        std::string("gamma0"), std::string("U (k = 2)")}) {
    EXPECT_TRUE(has(page, part)) << part;
  }
}

TEST_F(ModelPage, SaysCoverageAgainstTheStatedSigmaBesideThatOfItsOwnIntervals) {
  const CompensatedModel model = trained("none");
  const double stated = model.parts().training.coverage_95_stated.value();
  EXPECT_TRUE(
      has(model_page(model, std::nullopt), fmt::format("{:.1f} % of coordinates", 100 * stated)));
  EXPECT_TRUE(has(model_page(model, std::nullopt), "inside that of the stated sigma alone"));
}

TEST_F(ModelPage, ShowsWhichCausesTheMeasurementsChoseAndWhatEachBrought) {
  CompensatedModel::Parts parts = trained("none").parts();
  EXPECT_FALSE(has(model_page(trained("none"), std::nullopt), "chose the error sources"));
  parts.cause_choice =
      CauseChoice{60e-6,
                  {{{"joint_map:2"}, 1e-4, 6e-5, 120, 14, true, "the poses show it"},
                   {{"wrist_coupling"}, 6e-5, 6e-5, 0.1, 3, false, "the poses do not show it"}}};
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_TRUE(has(page, "it is 0.0600 mm"));
  EXPECT_TRUE(has(page, "not shown by these poses: wrist coupling."));
  for (const char* part : {">angle error map in joint 2</td>", ">0.1000</td>", ">0.0600</td>",
                           ">taken: the poses show it</td>"})
    EXPECT_TRUE(has(page, part)) << part;
}

TEST_F(ModelPage, CallsErrorSourcesByTheirPlainNames) {
  CompensatedModel::Parts parts = trained("none").parts();
  parts.provenance.level = "base,geometry,compliance_linear,gear_transmission:3@48.5";
  parts.provenance.refits = {RefitRecord{
      .model = "m", .sources = {"base", "tool"}, .batch_id = "b", .batch_hash = "", .poses = 9}};
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_TRUE(
      has(page, "base position, link geometry, gearbox compliance, gear ripple in joint 3"));
  EXPECT_TRUE(has(page, "base position, tool position on 9 poses"));
  EXPECT_FALSE(has(page, "gear_transmission"));
}

TEST_F(ModelPage, ShowsWhatIsLeftOfTheOrientationsWhereTheyWereMeasured) {
  CompensatedModel::Parts parts = trained("none").parts();
  parts.training.orientation = OrientationFigures{30, 0.02, 0.002, 0.001, 0.934};
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_TRUE(has(page, "orientation, deg rms of 30 poses"));
  for (const char* shown :
       {"nominal\">1.1459</td>", "calibrated\">0.1146</td>", "compensated\">0.0573</td>",
        "inside their 95 % interval\">93.4 %</td>"})
    EXPECT_TRUE(has(page, shown)) << shown;
  parts.training.orientation.reset();
  EXPECT_FALSE(
      has(model_page(CompensatedModel::make(parts).value(), std::nullopt), "orientation, deg"));
}

TEST_F(ModelPage, ABiasThatDoesNotHelpIsSaidNotToAndIsNotGreen) {
  CompensatedModel::Parts parts = trained("se", 0.3).parts();
  parts.validation->calibrated.rms = 22.9e-6;
  parts.validation->compensated.rms = 23.3e-6;
  parts.validation->bias_gain_z = -2;
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_TRUE(
      has(page, "The bias does not help here: 0.0233 mm with it, 0.0229 mm without on 9 poses."));
  EXPECT_TRUE(
      has(page, "<div class=\"tile doubtful\"><b>0.023 mm</b><span>compensated, rms</span>"));
  EXPECT_EQ(chart_data(page).at("doubtful"), true);
  parts.validation->compensated.rms = 10e-6;
  parts.validation->bias_gain_z = 5;
  const std::string helped = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_FALSE(has(helped, "The bias does not help"));
  EXPECT_TRUE(has(helped, "<div class=\"tile compensated\">"));
}

TEST_F(ModelPage, ErrorsThatAreSmallByTheFitAloneAreSaidToTellNothing) {
  const char* said = "does not tell how well others are met; train on ";
  CompensatedModel::Parts parts = trained("none").parts();
  parts.training.orientation.reset();
  parts.training.gauges.reset();
  parts.rank = 3 * parts.training.poses / 2;
  EXPECT_FALSE(has(model_page(CompensatedModel::make(parts).value(), std::nullopt), said));
  ++parts.rank;
  EXPECT_TRUE(has(model_page(CompensatedModel::make(parts).value(), std::nullopt), said));
  parts.training.orientation = OrientationFigures{parts.training.poses, 0.02, 0.002, 0.001, 0.934};
  EXPECT_FALSE(has(model_page(CompensatedModel::make(parts).value(), std::nullopt), said));
}

TEST_F(ModelPage, SaysThatComplianceWithoutALoadDoesNothing) {
  TrainOptions options;
  options.level = "M3";
  options.bias = "none";
  const CompensatedModel model = train(cell_, batch_, options).value();
  EXPECT_TRUE(has(model_page(model, std::nullopt),
                  "Gearbox compliance does nothing here: neither link masses nor a payload"));
  EXPECT_FALSE(has(model_page(trained("none"), std::nullopt), "does nothing here"));
}

TEST_F(ModelPage, OpensWithoutANetwork) {
  const std::string page = model_page(trained("none"), std::nullopt);
  EXPECT_TRUE(has(page, "Chart.js v"));
  EXPECT_FALSE(has(page, "<link"));
  EXPECT_FALSE(has(page, " src="));
}

TEST_F(ModelPage, CountsEveryPoseOfTheBatchInItsHistogram) {
  const auto checked = check_against_cell(batch_, *cell_);
  const auto histogram = chart_data(model_page(trained("none"), checked->rows())).at("histogram");
  for (const char* level : {"nominal", "calibrated", "compensated"}) {
    const auto counts = histogram.at(level).get<std::vector<int>>();
    EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), 0), 30) << level;
    EXPECT_EQ(counts.size(), histogram.at("labels_mm").size());
  }
}

TEST_F(ModelPage, WithoutABatchShowsThePosesHeldOutAndTheTrainingLeftOutOneByOne) {
  const std::string page = model_page(trained("se", 0.2), std::nullopt);
  EXPECT_TRUE(has(page, "On 6 poses of batch"));
  const auto counts = chart_data(page).at("histogram").at("compensated").get<std::vector<int>>();
  EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), 0), 24);
}

TEST_F(ModelPage, DrawsNoHistogramWhereItKnowsNoPoses) {
  EXPECT_FALSE(chart_data(model_page(trained("none"), std::nullopt)).contains("histogram"));
}

/// small_cell() with more keys.
std::shared_ptr<const Cell> cell_with(const std::string& keys) {
  return std::make_shared<const Cell>(parse_cell(test::small_cell_yaml("cell-3", "none") + keys,
                                                 test::small_robot_yaml(), "cell-3.yaml")
                                          .value());
}

NextCheck next_of(const CompensatedModel& model) {
  return next_check(model.provenance(), "", unix_now());
}

CompensatedModel trained_on(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                            const std::string& level = "M1") {
  TrainOptions options;
  options.level = level;
  options.bias = "none";
  options.trained_at = 1'763'942'400;  // 2025-11-24
  return train(cell, check_against_cell(batch, *cell, drawn(0.3, 1)).value(), options).value();
}

TEST_F(ModelPage, BeginsWithHowGoodItIsWhereAndUntilWhen) {
  const CompensatedModel model = trained_on(cell_with(""), batch_);
  const auto accuracy = PositionAccuracy::of(model);
  const std::string promise = promise_sentence(model, accuracy, next_of(model));
  EXPECT_EQ(promise,
            fmt::format("Good to {} mm at 95 % in this volume, by its training poses alone; not "
                        "known beyond; check again by 2025-12-24, a day that has passed.",
                        rounded_up_mm(accuracy->at(0.95))));
  const std::string page = model_page(model, std::nullopt);
  EXPECT_TRUE(has(page, "<p id=\"promise\">" + promise));
  EXPECT_LT(page.find(promise), page.find("<table"));
}

TEST_F(ModelPage, IsToBeCheckedAgainAsItsLastCheckSays) {
  const CompensatedModel model = trained_on(cell_with(""), batch_);
  const auto check = [&](const std::string& id, const std::string& verdict) {
    return fmt::format(R"({{"model": "{}", "verdict": "{}", "why": "so", "due": "2199-02-03"}})",
                       id, verdict);
  };
  const std::string id = model.provenance().id;
  EXPECT_TRUE(has(model_page(model, std::nullopt, check(id, "healthy")),
                  "; check again by 2199-02-03.</p>"));
  EXPECT_TRUE(has(model_page(model, std::nullopt, check(id, "changed")),
                  "its last check says that the robot has changed since"));
  EXPECT_TRUE(has(model_page(model, std::nullopt, check("another", "healthy")),
                  "check again by 2025-12-24"));
}

TEST_F(ModelPage, HasANumberThatIsOfWhatItCertifies) {
  const auto number_of = [](const std::string& page) {
    static const std::string kRow = "<td>certificate</td><td>";
    const std::size_t at = page.find(kRow);
    return at == std::string::npos ? "" : page.substr(at + kRow.size(), 17);
  };
  const CompensatedModel model = trained_on(cell_with("instrument_certificate: DE-17\n"), batch_);
  const std::string page = model_page(model, std::nullopt);
  EXPECT_TRUE(has(page, "<td>instrument's certificate</td><td>DE-17</td>"));
  EXPECT_EQ(number_of(page), number_of(model_page(model, std::nullopt)));
  EXPECT_EQ(number_of(page).substr(0, 9), model.provenance().hash.substr(0, 8) + "-");
  EXPECT_NE(number_of(page),
            number_of(model_page(model, check_against_cell(batch_, *cell_)->rows())));
}

TEST_F(ModelPage, SaysWhatWasMeasuredAndDrawsIt) {
  MeasurementBatch both = batch_;
  for (std::size_t i = 0; i < both.measurements.size(); ++i) {
    both.measurements[i].context.direction.assign(6, i % 2 == 0 ? -1 : 1);
    both.measurements[i].context.temperature = 20 + 0.1 * static_cast<double>(i);
  }
  const CompensatedModel model = trained_on(cell_with("instrument: AT960\n"), both);
  const std::string page = model_page(model, std::nullopt);
  for (const char* part :
       {"<td>sides of approach</td><td>every joint from both sides</td>",
        "<td>temperature</td><td>20.", " degrees Celsius</td>",
        "mm of the tool from the robot's base",
        "<p class=\"about\">It rests on 21 training poses; sides of approach: every joint"})
    EXPECT_TRUE(has(page, part)) << part;
  EXPECT_FALSE(
      has(promise_sentence(model, PositionAccuracy::of(model), next_of(model)), "comes to"));
  const auto promised = chart_data(page).at("scene").at("promised");
  EXPECT_TRUE(has(page, fmt::format("up to {:.0f} mm from the first axis",
                                    promised.at("radius_mm").get<double>())));
  EXPECT_TRUE(has(page, "<td>measured (green)</td>"));
  EXPECT_GT(promised.at("volume_m3").get<double>(), 0);
  const double radius = promised.at("radius_mm").get<double>() / 1000;
  const double height =
      (promised.at("upper").at(2).get<double>() - promised.at("lower").at(2).get<double>()) / 1000;
  EXPECT_LE(promised.at("volume_m3").get<double>(), kPi * radius * radius * height * 1.001);
  const auto box = chart_data(page).at("scene").at("box");
  EXPECT_NEAR(box.at(0).at(0), to_mm(model.parts().measured->lower.x()), 0.06);
  EXPECT_NEAR(box.at(1).at(2), to_mm(model.parts().measured->upper.z()), 0.06);
}

TEST_F(ModelPage, APromiseOfPosesFromOneSideIsOfThatSide) {
  MeasurementBatch above = batch_;
  for (Measurement& m : above.measurements) m.context.direction.assign(6, -1);
  const CompensatedModel model = trained_on(cell_with(""), above);
  EXPECT_TRUE(has(promise_sentence(model, PositionAccuracy::of(model), next_of(model)),
                  " in this volume, for poses that the arm comes to from above, by its training "
                  "poses alone; not"));
  EXPECT_TRUE(has(model_page(model, std::nullopt),
                  "nothing is promised of poses that it comes to from the other side"));
}

TEST_F(ModelPage, OfAModelThatDoesNotTellWhatWasMeasuredItSaysSo) {
  CompensatedModel::Parts parts = trained("none").parts();
  parts.measured.reset();
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  for (const char* part : {"<td>this volume</td><td>not on record</td>",
                           "<td>sides of approach</td><td>not on record"})
    EXPECT_TRUE(has(page, part)) << part;
}

TEST_F(ModelPage, SaysFirstWhereNoPoseHasTestedIt) {
  const CompensatedModel model = trained("none");
  EXPECT_TRUE(has(promise_sentence(model, PositionAccuracy::of(model), next_of(model)),
                  " volume, by its training poses alone; not"));
  const auto tested = PositionAccuracy::of(model, check_against_cell(batch_, *cell_)->rows());
  EXPECT_TRUE(has(promise_sentence(model, tested, next_of(model)), " volume; not known beyond"));
  MeasurementBatch single = check_against_cell(batch_, *cell_)->rows();
  single.measurements.resize(1);
  EXPECT_TRUE(has(promise_sentence(model, PositionAccuracy::of(model, single), next_of(model)),
                  ", tested by 1 fresh pose only; not"));
}

TEST_F(ModelPage, SaysThatTheDayOfTheNextCheckHasPassedWhereItHas) {
  EXPECT_TRUE(
      has(model_page(trained_on(cell_with(""), batch_), std::nullopt), "That day had passed"));
  CompensatedModel::Parts parts = trained_on(cell_with(""), batch_).parts();
  parts.provenance.trained_at = unix_now();
  parts.provenance.measured_at = unix_now();
  EXPECT_FALSE(
      has(model_page(CompensatedModel::make(parts).value(), std::nullopt), "That day had passed"));
}

TEST(RoundedUp, IsNeverSmallerThanTheLength) {
  EXPECT_EQ(rounded_up_mm(0.0811e-3), "0.082");
  EXPECT_EQ(rounded_up_mm(0.08e-3), "0.080");
  EXPECT_EQ(rounded_up_mm(1.31e-3), "1.4");
  EXPECT_EQ(rounded_up_mm(0.00811e-3), "0.0082");
}

TEST_F(ModelPage, ItsFirstPageNamesRobotInstrumentAndOperatorAsTheCellFileHasThem) {
  const std::string page = model_page(
      trained_on(cell_with("serial_number: 66-70 <b>\ninstrument: AT960\noperator: I. Newton\n"),
                 batch_),
      std::nullopt);
  for (const char* part :
       {"<td>serial number</td><td>66-70 &lt;b&gt;</td>", "AT960, 0.02 mm", "I. Newton"})
    EXPECT_TRUE(has(page, part)) << part;
  EXPECT_TRUE(has(model_page(trained("none"), std::nullopt),
                  "<td>serial number</td><td>not in the cell file</td>"));
}

TEST_F(ModelPage, HoldsThePromiseAgainstTheToleranceOfTheCell) {
  EXPECT_TRUE(has(model_page(trained_on(cell_with("tolerance_mm: 0.2\n"), batch_), std::nullopt),
                  "The cell must hold 0.2 mm: <b>yes</b>"));
  EXPECT_TRUE(has(model_page(trained_on(cell_with("tolerance_mm: 0.002\n"), batch_), std::nullopt),
                  "The cell must hold 0.002 mm: <b>no</b>"));
  EXPECT_FALSE(has(model_page(trained("none"), std::nullopt), "The cell must hold"));
}

TEST_F(ModelPage, SaysYesOrNoToNoToleranceThatIsInsideItsInterval) {
  const auto promise = PositionAccuracy::of(trained_on(cell_with(""), batch_));
  ASSERT_LT(promise->least(), promise->most());
  for (const double tolerance : {0.9 * promise->least() + 0.1 * promise->most(),
                                 0.1 * promise->least() + 0.9 * promise->most()}) {
    const auto cell = cell_with(fmt::format("tolerance_mm: {}\n", 1000 * tolerance));
    EXPECT_TRUE(has(model_page(trained_on(cell, batch_), std::nullopt), " mm: <b>cannot tell</b>"))
        << tolerance;
  }
}

TEST_F(ModelPage, KnowsTheRepeatabilityFromRepeatsOnly) {
  const CompensatedModel model = trained("none");
  MeasurementBatch repeated = check_against_cell(batch_, *cell_)->rows();
  const auto row = [&](const MeasurementBatch& batch) {
    const std::string page = model_page(model, batch);
    const std::size_t from = page.find("repeatability RP");
    return page.substr(from, page.find("</tr>", from) - from);
  };
  EXPECT_TRUE(has(row(repeated), "not measured")) << row(repeated);
  const auto once = repeated.measurements;
  repeated.measurements.insert(repeated.measurements.end(), once.begin(), once.end());
  for (std::size_t i = 0; i < once.size(); ++i) repeated.measurements[i].p_W.x() += 40e-6;
  // Two that are 40 um apart: 28 um along x, 16 um an axis; 3.615 of them.
  EXPECT_TRUE(has(row(repeated), "0.060 mm, instrument included (60 measurements of 30 poses)"))
      << row(repeated);
}

TEST_F(ModelPage, TellsOfEveryLengthWhatIsDrawnByHowMuchItIsOffAndWhatItIs) {
  const CompensatedModel model = trained_on(cell_with(""), batch_, "M2");
  const auto& parameters = model.parts().parameters;
  const auto a2 = std::find_if(parameters.begin(), parameters.end(),
                               [](const auto& one) { return one.parameter.name == "a2"; });
  ASSERT_NE(a2, parameters.end());
  const std::string page = model_page(model, std::nullopt);
  const std::size_t from = page.find("<tr><td>a2</td>");
  ASSERT_NE(from, std::string::npos);
  std::istringstream cells(page.substr(from + 15, 200));
  const double drawn = 1e3 * cell_->robot.joint(1).link.a;
  char skip = 0;
  double nominal = 0, correction = 0, result = 0;
  const auto number = [&](double* into) {
    while (cells.get(skip) && skip != '>') {
    }
    cells >> *into;
    while (cells.get(skip) && skip != '>') {
    }
  };
  EXPECT_EQ(page.substr(from, 200).find("e-0"), std::string::npos) << page.substr(from, 200);
  number(&nominal);
  number(&correction);
  number(&result);
  EXPECT_NEAR(nominal, drawn, 1e-9);
  EXPECT_NEAR(correction, 1e3 * a2->value, 0.01);
  EXPECT_NEAR(result, nominal + correction, 0.02);
}

TEST_F(ModelPage, DrawsTheArmFromTheBaseToTheToolAndTheDomainAroundItsPoses) {
  const CompensatedModel model = trained("none");
  const auto checked = check_against_cell(batch_, *cell_);
  const auto scene = scene_json(model, poses_to_show(model, checked->rows()));
  ASSERT_EQ(scene.at("poses").size(), 30u);
  for (std::size_t i = 0; i < 30; ++i) {
    const auto& arm = scene.at("poses")[i].at("arm");
    const Measurement& m = checked->rows().measurements[i];
    const Vector3 tool =
        (cell_->robot.flange_pose(m.context.q) * *cell_->tools.at(m.context.tool)).translation();
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(arm.back()[static_cast<std::size_t>(k)].get<double>(), 1e3 * tool(k), 0.06);
    EXPECT_EQ(arm.front(), nlohmann::ordered_json({0.0, 0.0, 0.0}));
    EXPECT_GT(arm.size(), 4u);
  }
  double farthest = 0;
  for (const auto& ring : scene.at("shell")) {
    for (const auto& p : ring)
      if (!p.is_null())
        farthest = std::max(farthest, std::hypot(p[0].get<double>(), p[1].get<double>()));
  }
  EXPECT_GT(farthest, 500);
}

TEST_F(ModelPage, WithoutAnyMeasuredPoseItsArrowsAreWhatTheModelCorrects) {
  const CompensatedModel model = trained("none");
  const auto scene = scene_json(model, poses_to_show(model, std::nullopt));
  EXPECT_EQ(scene.at("measured"), false);
  const auto& before = scene.at("poses")[0].at("before");
  // The base stands 2 mm along x from where it should be.
  EXPECT_NEAR(std::hypot(before[0].get<double>(), before[1].get<double>(), before[2].get<double>()),
              2, 0.2);
}

TEST_F(ModelPage, TheCurveOfABiasEndsAtAllPosesAndThatOfParametersFallsWithThem) {
  test::SmallBatch shape;
  shape.poses = 60;
  batch_ = parse_batch_csv(test::small_batch_csv(*cell_, shape), "b.csv").value();
  const CompensatedModel learned = trained("se");
  const auto curve = learning_curve(learned);
  ASSERT_TRUE(curve);
  EXPECT_EQ(curve->poses, (std::vector<int>{15, 30, 45, 60}));
  EXPECT_NEAR(curve->error.back(), learned.bias()->report().leave_one_out_rms, 1e-9);
  const auto parameters = learning_curve(trained("none"));
  ASSERT_TRUE(parameters);
  EXPECT_EQ(parameters->poses, (std::vector<int>{30, 60, 120, 240}));
  EXPECT_GT(parameters->error[0], parameters->error[3]);
  EXPECT_TRUE(has(model_page(learned, std::nullopt), curve->sentence));
}

TEST_F(ModelPage, ListsAllPosesTheWorstFirst) {
  const auto checked = check_against_cell(batch_, *cell_);
  MeasurementBatch rows = checked->rows();
  rows.measurements[7].p_W.z() += 1e-3;
  const std::string page = model_page(trained("none"), rows);
  const std::size_t table = page.find("<table class=\"poses ");
  ASSERT_NE(table, std::string::npos);
  const std::size_t first = page.find("<tr><td>", table);
  EXPECT_EQ(page.substr(first + 8, rows.measurements[7].pose_id.size() + 1),
            rows.measurements[7].pose_id + "<");
  const std::string listed = page.substr(table, page.find("</table>", table) - table);
  std::size_t count = 0;
  for (std::size_t at = listed.find("<tr><td>"); at != std::string::npos;
       at = listed.find("<tr><td>", at + 1))
    ++count;
  EXPECT_EQ(count, rows.measurements.size());
}

TEST_F(ModelPage, ItsTableOfPosesSortsByAColumnThatIsClickedOn) {
  if (!test::has_browser()) GTEST_SKIP() << test::kBrowser << " is not installed";
  std::string page = model_page(trained("none"), check_against_cell(batch_, *cell_)->rows());
  page.replace(page.rfind("</body>"), 7, R"(<script>window.addEventListener("load", () => {
    const table = document.querySelector("table.sorts"), head = table.querySelectorAll("th")[4];
    const seen = () => [...table.tBodies[0].rows].map(row => Number(row.cells[4].textContent));
    const falls = list => list.every((v, i) => i === 0 || v <= list[i - 1]) ? 1 : 0;
    window.clicks = [falls(seen())];
    head.click(); window.clicks.push(falls(seen()));
    head.click(); window.clicks.push(falls(seen().reverse()));
    const told = document.createElement("p"); told.id = "told";
    told.textContent = "clicks " + window.clicks.join("");
    document.body.append(told);
  });</script></body>)");
  EXPECT_TRUE(has(test::dom_in_browser(page), "clicks 011"));
}

TEST_F(ModelPage, IsTwoSheetsOfPaperBeforeItsAppendix) {
  if (!test::has_browser()) GTEST_SKIP() << test::kBrowser << " is not installed";
  const CompensatedModel model = trained("se", 0.3);
  std::string page = model_page(model, check_against_cell(batch_, *cell_)->rows());
  EXPECT_GT(test::pages_on_paper(page), 2);
  page.replace(page.rfind("</body>"), 7,
               "<script>document.getElementById('appendix').remove();</script></body>");
  EXPECT_LE(test::pages_on_paper(page), 2);
}

TEST_F(ModelPage, HasNoEmptyPlotInARealBrowserHoweverNarrowAndIsLight) {
  const CompensatedModel model = trained("se", 0.3);
  const std::string page = model_page(model, check_against_cell(batch_, *cell_)->rows());
  EXPECT_LT(page.size(), 1'500'000u);
  if (!test::has_browser()) GTEST_SKIP() << test::kBrowser << " is not installed";
  for (const int width : {1200, 500}) {  // no window of this browser is narrower
    std::map<std::string, int> seen = test::seen_by_browser(page, width);
    EXPECT_EQ(seen["errors"], 0) << width;
    EXPECT_LE(seen["page-too-wide"], 0) << width;
    for (const char* canvas : {"levels", "histogram", "coverage", "space"})
      EXPECT_GT(seen[canvas], 100) << canvas << width;
  }
}

TEST_F(ModelPage, NamesFromFilesStayText) {
  const std::string page = model_page(trained("none"), check_against_cell(batch_, *cell_)->rows());
  EXPECT_FALSE(has(page, "lt-<03>"));
  EXPECT_TRUE(has(page, "lt-&lt;03&gt;"));
}

TEST_F(ModelPage, SaysInWordsWhatCouldNotBeTold) {
  CompensatedModel::Parts parts = trained("none").parts();
  parts.unidentifiable = {{0.1, {"q1", "gamma0"}, "q1 & gamma0 turn the same way"}};
  EXPECT_TRUE(has(model_page(CompensatedModel::make(parts).value(), std::nullopt),
                  "<li>q1 &amp; gamma0 turn the same way</li>"));
  parts.unidentifiable.clear();
  EXPECT_TRUE(has(model_page(CompensatedModel::make(parts).value(), std::nullopt),
                  "Nothing: every combination"));
}

/// The page of a model that was trained on so many poses, none held out.
std::string page_of_poses(int poses) {
  const auto cell = cell_with("");
  test::SmallBatch shape;
  shape.poses = poses;
  const MeasurementBatch batch =
      parse_batch_csv(test::small_batch_csv(*cell, shape), "few.csv").value();
  TrainOptions options;
  options.level = "M1";
  options.bias = "none";
  return model_page(
      train(cell, check_against_cell(batch, *cell, drawn(0, 1)).value(), options).value(),
      std::nullopt);
}

TEST_F(ModelPage, PromisesNothingWhereThePosesAreTooFewToTellHowGoodTheModelIs) {
  for (const int poses : {1, 3}) {
    const std::string page = page_of_poses(poses);
    EXPECT_TRUE(has(page, "How good this model is cannot be said from so few poses")) << poses;
    EXPECT_TRUE(has(page, "trammel plan chooses the poses")) << poses;
    for (const char* part : {"Good to ", "class=\"tolerances", "class=\"iso", "The cell must hold"})
      EXPECT_FALSE(has(page, part)) << poses << ": " << part;
  }
  EXPECT_TRUE(has(page_of_poses(30), "<p id=\"promise\">Good to "));
}

TEST_F(ModelPage, PromisesNothingByPosesThatAreNotThisRobots) {
  MeasurementBatch exchanged = check_against_cell(batch_, *cell_)->rows();
  for (Measurement& m : exchanged.measurements) std::swap(m.p_W.x(), m.p_W.y());
  const std::string page = model_page(trained("none"), exchanged);
  EXPECT_TRUE(has(page, "these poses do not fit the model"))
      << page.substr(page.find("id=\"promise"), 600);
  EXPECT_TRUE(has(page, "exchanged"));
  EXPECT_FALSE(has(page, "Good to "));
  EXPECT_FALSE(has(page, "class=\"tolerances"));
}

TEST_F(ModelPage, ASingleBadPoseDoesNotMakeABatchThatOfAnotherRobot) {
  const CompensatedModel model = trained("none");
  MeasurementBatch own = check_against_cell(batch_, *cell_)->rows();
  EXPECT_EQ(why_no_promise(model, PositionAccuracy::of(model, own), own), std::nullopt);
  own.measurements.front().p_W.x() += 1;
  EXPECT_EQ(why_no_promise(model, PositionAccuracy::of(model, own), own), std::nullopt);
}

}  // namespace
}  // namespace trammel
