#include "server/report/model_page.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numeric>

#include "server/measurement/checked_batch.h"
#include "server/trainer/pipeline/train.h"
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
    const CheckedBatch checked = check_against_cell(batch_, *cell_, drawn(validation_share, 1)).value();
    return train(cell_, checked, options).value();
  }
  /// What the charts of the page are drawn from.
  static nlohmann::json chart_data(const std::string& page) {
    const std::string opening = "<script type=\"application/json\" id=\"data\">";
    const std::size_t from = page.find(opening) + opening.size();
    return nlohmann::json::parse(page.substr(from, page.find("</script>", from) - from));
  }
  static bool has(const std::string& page, const std::string& part) { return page.find(part) != std::string::npos; }

  std::shared_ptr<const Cell> cell_;
  MeasurementBatch batch_;
};

TEST_F(ModelPage, ShowsWhereTheModelComesFromAndItsParameters) {
  const CompensatedModel model = trained("none");
  const std::string page = model_page(model, std::nullopt);
  for (const std::string& part : {model.provenance().hash, model.provenance().batch_hash, cell_->robot.name(),
                                  std::string("gamma0"), std::string("U (k = 2)")}) {
    EXPECT_TRUE(has(page, part)) << part;
  }
}

TEST_F(ModelPage, CallsErrorSourcesByTheirPlainNames) {
  CompensatedModel::Parts parts = trained("none").parts();
  parts.provenance.level = "base,geometry,compliance_linear,gear_transmission:3@48.5";
  parts.provenance.refits = {
      RefitRecord{.model = "m", .sources = {"base", "tool"}, .batch_id = "b", .batch_hash = "", .poses = 9}};
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_TRUE(has(page, "base position, link geometry, gearbox compliance, gear ripple in joint 3"));
  EXPECT_TRUE(has(page, "base position, tool position on 9 poses"));
  EXPECT_FALSE(has(page, "gear_transmission"));
}

TEST_F(ModelPage, ShowsWhatIsLeftOfTheOrientationsWhereTheyWereMeasured) {
  CompensatedModel::Parts parts = trained("none").parts();
  parts.training.orientation = OrientationFigures{30, 0.02, 0.002, 0.001, 0.934};
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_TRUE(has(page, "orientation, deg rms of 30 poses"));
  EXPECT_TRUE(has(page, "<td>1.1459</td><td>0.1146</td><td>0.0573</td><td>93.4 %</td>"));
  parts.training.orientation.reset();
  EXPECT_FALSE(has(model_page(CompensatedModel::make(parts).value(), std::nullopt), "orientation, deg"));
}

TEST_F(ModelPage, ABiasThatDoesNotHelpIsSaidNotToAndIsNotGreen) {
  CompensatedModel::Parts parts = trained("se", 0.3).parts();
  parts.validation->calibrated.rms = 22.9e-6;
  parts.validation->compensated.rms = 23.3e-6;
  parts.validation->bias_gain_z = -2;
  const std::string page = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_TRUE(has(page, "The bias does not help here: 0.0233 mm with it, 0.0229 mm without on 9 poses."));
  EXPECT_TRUE(has(page, "<div class=\"tile doubtful\"><b>0.023 mm</b><span>compensated, rms</span>"));
  EXPECT_EQ(chart_data(page).at("doubtful"), true);
  parts.validation->compensated.rms = 10e-6;
  parts.validation->bias_gain_z = 5;
  const std::string helped = model_page(CompensatedModel::make(parts).value(), std::nullopt);
  EXPECT_FALSE(has(helped, "The bias does not help"));
  EXPECT_TRUE(has(helped, "<div class=\"tile compensated\">"));
}

TEST_F(ModelPage, SaysThatComplianceWithoutALoadDoesNothing) {
  TrainOptions options;
  options.level = "M3";
  options.bias = "none";
  const CompensatedModel model = train(cell_, batch_, options).value();
  EXPECT_TRUE(
      has(model_page(model, std::nullopt), "Gearbox compliance does nothing here: neither link masses nor a payload"));
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
  for (const char* level : {"calibrated", "compensated"}) {
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
  EXPECT_TRUE(has(model_page(CompensatedModel::make(parts).value(), std::nullopt), "Nothing: every combination"));
}

}  // namespace
}  // namespace trammel
