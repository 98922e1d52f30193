#include "clients/cli/text/evaluation_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/base/units.h"
#include "tests/support/small_cell.h"

namespace trammel::cli {
namespace {

Evaluation evaluation() {
  Evaluation evaluation;
  evaluation.poses = 7;
  evaluation.in_domain = 6;
  evaluation.coverage_95 = .9;
  evaluation.nlpd = -9.25;
  evaluation.nominal.rms = 3e-3;
  evaluation.calibrated.rms = 4e-4;
  evaluation.compensated = {
      1e-4, 9e-5, 2e-4, 3e-4, Vector3(1e-5, 2e-5, -3e-5), Vector3(4e-5, 5e-5, 6e-5)};
  return evaluation;
}

TEST(EvaluationJson, HasAnOrientationInDegreesWhereOneWasMeasuredAndSoHasTheText) {
  EXPECT_FALSE(evaluation_json(evaluation()).contains("orientation"));
  Evaluation turned = evaluation();
  turned.orientation = {5, kPi / 180, kPi / 360, kPi / 1800, std::nullopt};
  auto json = evaluation_json(turned)["orientation"];
  EXPECT_EQ(json["poses"], 5);
  EXPECT_DOUBLE_EQ(json["nominal"]["rms_deg"], 1.0);
  EXPECT_DOUBLE_EQ(json["calibrated"]["rms_deg"], 0.5);
  EXPECT_DOUBLE_EQ(json["compensated"]["rms_deg"], 0.1);
  EXPECT_FALSE(json.contains("coverage_95"));
  turned.orientation->coverage_95 = .95;
  EXPECT_EQ(evaluation_json(turned)["orientation"]["coverage_95"], .95);
  EXPECT_NE(
      evaluation_table(turned).find("orientation, deg rms of 5 poses: nominal 1.0000, calibrated "
                                    "0.5000, compensated 0.1000; 95.0 % of rotations"),
      std::string::npos);
}

TEST(EvaluationJson, TellsDistancesByThemselvesAndNoFigureOfPositionsWhereNoneWasMeasured) {
  Evaluation wires;
  wires.nominal = wires.calibrated = wires.compensated = no_figures();
  wires.gauges = {12, 3e-3, 6e-5, 5e-5, 1e-4, .9, 11, {}};
  const auto alone = evaluation_json(wires);
  EXPECT_FALSE(alone.contains("rms_mm"));
  EXPECT_FALSE(alone.contains("levels"));
  EXPECT_EQ(alone["gauges"]["rows"], 12);
  EXPECT_NEAR(alone["gauges"]["rms_mm"], 0.05, 1e-12);
  EXPECT_EQ(evaluation_table(wires).find("nan"), std::string::npos);
  EXPECT_NE(evaluation_table(wires).find("mm rms of 12 values"), std::string::npos);
  Evaluation both = evaluation();
  both.gauges = wires.gauges;
  EXPECT_NEAR(evaluation_json(both)["rms_mm"], 0.1, 1e-12) << "of positions, as before";
  EXPECT_EQ(evaluation_json(both)["gauges"]["in_domain"], 11);
}

TEST(ResidualsCsv, HasARowAPoseInMillimetresAndMarksSuspects) {
  MeasurementBatch batch;
  for (const char* id : {"p1", "p,2"}) {
    Measurement m;
    m.pose_id = id;
    m.row = static_cast<int>(batch.measurements.size()) + 2;
    batch.measurements.push_back(m);
  }
  CompensatedModel::LevelErrors errors;
  errors.nominal = errors.calibrated = errors.compensated = errors.stddev =
      Eigen::Matrix3Xd::Constant(3, 2, 1e-5);
  errors.compensated.col(1) = Vector3(3e-5, 4e-5, 0);
  errors.compensated(2, 1) = 6e-5;
  errors.in_domain = {true, false};
  EXPECT_EQ(
      residuals_csv(batch, errors),
      "pose_id,row,error_mm,ex_mm,ey_mm,ez_mm,sx_mm,sy_mm,sz_mm,zx,zy,zz,calibrated_mm,cx_mm,cy_mm,"
      "cz_mm,nominal_mm,in_domain,suspect\n"
      "p1,2,0.0173205,0.01,0.01,0.01,0.01,0.01,0.01,1,1,1,0.0173205,0.01,0.01,0.01,0.0173205,1,0\n"
      "\"p,2\",3,0.0781025,0.03,0.04,0.06,0.01,0.01,0.01,3,4,6,0.0173205,0.01,0.01,0.01,0.0173205,"
      "0,1\n");
}

TEST(EvaluationJson, HasExactlyItsPinnedKeysInMillimetres) {
  const std::string compensated =
      R"("rms_mm":0.1,"mean_mm":0.09,"p997_mm":0.2,"max_mm":0.3,"axis":{"x":{"mean_mm":0.01,"std_mm":0.04},)"
      R"("y":{"mean_mm":0.02,"std_mm":0.05},"z":{"mean_mm":-0.03,"std_mm":0.06}})";
  auto json = evaluation_json(evaluation());
  EXPECT_EQ(json["levels"]["nominal"]["rms_mm"], 3.0);
  EXPECT_EQ(json["levels"]["calibrated"]["rms_mm"], 0.4);
  EXPECT_NEAR(json["nlpd"].get<double>(), -9.25 + std::log(1000.0), 1e-12);
  json.erase("nlpd");
  json["levels"].erase("nominal");
  json["levels"].erase("calibrated");
  const auto expected =
      nlohmann::json::parse("{\"poses\":7," + compensated + ",\"levels\":{\"compensated\":{" +
                            compensated + "}},\"coverage_95\":0.9,\"in_domain\":6}");
  // Through text with 12 digits: a factor of 1000 may cost the last bit.
  std::function<nlohmann::json(const nlohmann::json&)> rounded =
      [&](const nlohmann::json& value) -> nlohmann::json {
    if (value.is_number_float()) return fmt::format("{:.12g}", value.get<double>());
    if (!value.is_structured()) return value;
    nlohmann::json copy = value;
    for (auto& item : copy) item = rounded(item);
    return copy;
  };
  EXPECT_EQ(rounded(nlohmann::json::parse(json.dump())), rounded(expected));
}

TEST(EvaluationTable, HasALineForEachLevel) {
  const std::string table = evaluation_table(evaluation());
  EXPECT_NE(table.find("nominal         3.0000"), std::string::npos) << table;
  EXPECT_NE(table.find("calibrated      0.4000"), std::string::npos) << table;
  EXPECT_NE(table.find("compensated     0.1000    0.0900    0.2000    0.3000"), std::string::npos)
      << table;
  EXPECT_NE(table.find("6 of 7 poses in domain; 90.0 %"), std::string::npos) << table;
  EXPECT_NE(table.find("-2.342 nat"), std::string::npos) << table;
  Evaluation old = evaluation();
  old.nlpd.reset();  // of a model of before it was kept
  EXPECT_EQ(evaluation_table(old).find("density"), std::string::npos);
  EXPECT_FALSE(evaluation_json(old).contains("nlpd"));
}

TEST(EvaluationTable, SaysWhereABiasDoesNotHelp) {
  EXPECT_EQ(evaluation_table(evaluation()).find("the bias"), std::string::npos);
  Evaluation worse = evaluation();
  worse.compensated.rms = 4.1e-4;
  worse.bias_gain_z = -3;
  EXPECT_NE(evaluation_table(worse).find(
                "the bias does not help here: 0.4100 mm with it, 0.4000 mm without on 7 poses"),
            std::string::npos);
  EXPECT_TRUE(evaluation_json(worse).contains("doubt_of_bias"));
  // A model without a bias: the same but for the last bit.
  Evaluation none = evaluation();
  none.compensated.rms = std::nextafter(none.calibrated.rms, 1);
  EXPECT_EQ(evaluation_table(none).find("the bias"), std::string::npos);
}

TEST(ModelText, SaysWhatCouldNotBeIdentified) {
  CompensatedModel::Parts parts = test::nominal_model(test::small_cell("cell-3"), 12).parts();
  parts.unidentifiable.push_back({0.1, {"q1", "gamma0"}, "q1 and gamma0 turn the same way"});
  const CompensatedModel model = CompensatedModel::make(std::move(parts)).value();
  const std::string text = model_text(model);
  EXPECT_NE(text.find("cell cell-3"), std::string::npos) << text;
  EXPECT_NE(text.find("q1 and gamma0 turn the same way"), std::string::npos) << text;
  EXPECT_EQ(model_json(model)["not_identifiable"][0]["parameters"][1], "gamma0");
}

TEST(ModelText, TellsWhatWasAskedBeforeABiasWasLeftOut) {
  CompensatedModel::Parts parts = test::nominal_model(test::small_cell("cell-3"), 12).parts();
  parts.bias_choice = BiasChoice{"none",
                                 {{"none", 23.6e-6, -9.8, 24e-6, 25e-6, 0, 0, "taken"},
                                  {"se", 23.8e-6, -9.7, 0, 0, 1e-12, 2e-12, "no"}},
                                 "no bias helps"};
  const CompensatedModel model = CompensatedModel::make(std::move(parts)).value();
  const std::string text = model_text(model);
  EXPECT_NE(text.find("no bias helps\n"), std::string::npos) << text;
  EXPECT_NE(text.find("none                                    0.0236      0.0240      0.0250      "
                      "  -2.892  taken"),
            std::string::npos)
      << text;
  const auto json = model_json(model)["bias_choice"];
  EXPECT_EQ(json["kernel"], "none");
  EXPECT_NEAR(json["candidates"][1]["leave_one_out_rms_mm"], 0.0238, 1e-12);
  EXPECT_NEAR(json["candidates"][1]["gain_mm2"], 1e-6, 1e-15);
}

TEST(ModelText, TellsWhichCausesWereTriedAndWhatEachBrought) {
  CompensatedModel::Parts parts = test::nominal_model(test::small_cell("cell-3"), 12).parts();
  parts.cause_choice =
      CauseChoice{60e-6,
                  {{{"joint_map:2"}, 100e-6, 60e-6, 120.5, 14, true, "the poses show it"},
                   {{"axis_runout:3"}, 60e-6, 61e-6, 4, 3, false, "it does not predict"},
                   {{"wrist_coupling"}, 60e-6, 60e-6, 0.1, 3, false, "the poses do not show it"}}};
  const CompensatedModel model = CompensatedModel::make(std::move(parts)).value();
  const std::string text = model_text(model);
  EXPECT_NE(text.find("predicted to 0.0600 mm"), std::string::npos) << text;
  EXPECT_NE(
      text.find("angle error map in joint 2                    0.1000    0.0600     120.5  yes"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("0.0600    0.0610       4.0  no: it does not predict"), std::string::npos)
      << text;
  EXPECT_NE(text.find("not shown by these poses: wrist coupling\n"), std::string::npos) << text;
  const auto json = model_json(model)["cause_choice"];
  EXPECT_NEAR(json["held_out_mm"], 0.06, 1e-12);
  EXPECT_EQ(json["tried"][0]["sources"][0], "joint_map:2");
  EXPECT_TRUE(json["tried"][0]["taken"]);
  EXPECT_NEAR(json["tried"][1]["held_out_after_mm"], 0.061, 1e-12);
}

}  // namespace
}  // namespace trammel::cli
