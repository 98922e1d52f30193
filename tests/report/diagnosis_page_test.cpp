#include "server/report/diagnosis_page.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "server/report/diagnosis_charts.h"
#include "tests/report/diagnosis_fixture.h"
#include "tests/report/seen_by_browser.h"
#include "tests/support/page_text.h"

namespace trammel {
namespace {

class DiagnosisPage : public testing::Test {
 protected:
  DiagnosisPage() : cell_(test::cell_7()), diagnosis_(test::made_up_diagnosis(cell_)) {}

  std::map<std::string, int> seen_by_a_browser(int width) const {
    return test::seen_by_browser(diagnosis_page(diagnosis_, *cell_), width);
  }

  std::shared_ptr<const Cell> cell_;
  Diagnosis diagnosis_;
};

TEST_F(DiagnosisPage, ShowsTheVerdictTheFindingsAndWhereItAllComesFrom) {
  const std::string page = diagnosis_page(diagnosis_, *cell_);
  for (const std::string& part :
       {diagnosis_.batch_hash, diagnosis_.cell_hash, std::string("these poses do not tell which"),
        std::string("48.503"), std::string("parameter ± U (k = 2)"), std::string("0.040"),
        std::string("link geometry (d6)"), std::string("p28"),
        std::string("repeat it and its neighbours"), std::string("both approach directions")}) {
    EXPECT_TRUE(test::has(page, part)) << part;
  }
}

TEST_F(DiagnosisPage, WhereNothingIsMissingSaysThatThisIsBeyondTheModel) {
  diagnosis_.verdict = Verdict::kNothing;
  EXPECT_TRUE(test::has(diagnosis_page(diagnosis_, *cell_), ">nothing beyond the model<"));
}

TEST_F(DiagnosisPage, ShowsAPlotACauseOfWhatWasProvedInPlaceOfWhatWasSimulated) {
  EXPECT_TRUE(test::has(diagnosis_page(diagnosis_, *cell_), "id=\"recovery\""));
  diagnosis_.recovery.clear();
  diagnosis_.proof = test::made_up_proof();
  const std::string page = diagnosis_page(diagnosis_, *cell_);
  EXPECT_FALSE(test::has(page, "id=\"recovery\""));
  for (const char* part : {"<b>27</b> (24 to 31)", "not named up to 90; found in doubt 9 of 9",
                           "9 or more; named 0 of 1", "named for sure in 1 of 28 diagnoses",
                           "with nothing put in, a cause was named in 1 of 12",
                           "2 diagnoses refused their batch", ">10</text>", ">40</text>"})
    EXPECT_TRUE(test::has(page, part)) << part;
  std::size_t plots = 0;
  for (std::size_t at = page.find("<svg class=\"proved\""); at != std::string::npos;
       at = page.find("<svg class=\"proved\"", at + 1))
    ++plots;
  EXPECT_EQ(plots, diagnosis_.proof->causes.size());
}

TEST_F(DiagnosisPage, CallsErrorSourcesByTheirPlainNames) {
  diagnosis_.sources_after.emplace_back("gear_transmission:3@48.5");
  const std::string page = diagnosis_page(diagnosis_, *cell_);
  EXPECT_TRUE(test::has(page, "base position, link geometry, gearbox compliance"));
  EXPECT_TRUE(test::has(page, "gear ripple in joint 3"));
  EXPECT_FALSE(test::has(page, "gear_transmission"));
}

TEST_F(DiagnosisPage, DoesNotSayHowOftenRepetitionsNameACause) {
  EXPECT_FALSE(test::has(diagnosis_page(diagnosis_, *cell_), "repetitions"));
  EXPECT_FALSE(test::has(diagnosis_page(diagnosis_, *cell_), "naming_frequency"));
}

TEST_F(DiagnosisPage, SpeaksOfOneKindOfIntervalOnly) {
  EXPECT_FALSE(test::has(diagnosis_page(diagnosis_, *cell_), "half its 95 % interval"));
}

TEST_F(DiagnosisPage, OpensWithoutANetworkAndKeepsNamesFromFilesText) {
  const std::string page = diagnosis_page(diagnosis_, *cell_);
  EXPECT_TRUE(test::has(page, "Chart.js v"));
  EXPECT_FALSE(test::has(page, "<link"));
  EXPECT_FALSE(test::has(page, " src="));
  EXPECT_FALSE(test::has(page, "made-up <1>"));
  EXPECT_TRUE(test::has(page, "made-up &lt;1&gt;"));
}

TEST_F(DiagnosisPage, FoldsAGearsOscillationWithoutAnyOtherCause) {
  diagnosis_.residual_before_B.array() += 1e-3;  // another cause, far larger
  const auto fold = diagnosis_charts(diagnosis_, *cell_).at("folds").at(0);
  ASSERT_GT(fold.at("phase_deg").size(), 50u);
  for (std::size_t i = 0; i < fold.at("phase_deg").size(); ++i) {
    const double wave = 50 * std::sin(from_deg(fold.at("phase_deg")[i].get<double>()) + 0.4);
    const double noise = fold.at("after_urad")[i].get<double>();
    EXPECT_NEAR(fold.at("alone_urad")[i].get<double>() - noise, wave, 0.5);
    EXPECT_LT(std::abs(noise), 5 * 13 / 0.3) << "13 um at the end of a lever of 0.3 m or more";
  }
  EXPECT_NEAR(fold.at("cycle").at("urad")[0].get<double>(), 50 * std::sin(0.4), 0.1);
}

TEST_F(DiagnosisPage, IsThreePagesOnPaperAtMost) {
  if (!test::has_browser()) GTEST_SKIP() << test::kBrowser << " is not installed";
  EXPECT_LE(test::pages_on_paper(diagnosis_page(diagnosis_, *cell_)), 3);
}

TEST_F(DiagnosisPage, ThinsAPeriodogramWithoutLosingItsPeak) {
  const auto joint_3 = diagnosis_charts(diagnosis_, *cell_).at("periodograms").at(2);
  EXPECT_LE(joint_3.at("order").size(), 500u);
  const auto strength = joint_3.at("strength").get<std::vector<double>>();
  EXPECT_NEAR(*std::max_element(strength.begin(), strength.end()),
              diagnosis_.periodograms[2].strength.maxCoeff(), 0.01);
}

TEST_F(DiagnosisPage, TitlesAPeriodogramByWhatWasFoundOfThatJoint) {
  // Joint 3's oscillation leaks into what is seen of joint 2.
  diagnosis_.periodograms[1].strength = diagnosis_.periodograms[2].strength;
  diagnosis_.findings.emplace_back().cause = {"gear_transmission", 2, "", "", 97.0};
  diagnosis_.findings.emplace_back().cause = {"joint_map", 2};
  diagnosis_.findings.emplace_back().cause = {"encoder_eccentricity", 4};
  diagnosis_.findings.emplace_back().cause = {"backlash", 5};
  const auto charts = diagnosis_charts(diagnosis_, *cell_);
  const auto title = [&](std::size_t k) {
    return charts.at("periodograms").at(k).at("title").get<std::string>();
  };
  EXPECT_EQ(title(1), "joint 2: no oscillation found");
  EXPECT_EQ(title(2), "joint 3: 48.50, 97.00 a turn, angle error map");
  EXPECT_EQ(title(4), "joint 5: 1 a turn");
  EXPECT_EQ(title(5), "joint 6: no oscillation found");
}

TEST_F(DiagnosisPage, AnswersOnWhatTheLeftoverDepends) {
  const std::string page = diagnosis_page(diagnosis_, *cell_);
  EXPECT_TRUE(test::has(page, "Does what is left depend on"));
  EXPECT_TRUE(test::has(page, "<tr class=\"yes\"><td>yes</td><td>the residual</td><td>q4</td>"));
  EXPECT_TRUE(test::has(page, "<tr class=\"no\"><td>no</td><td>its size</td><td>torque</td>"));
}

TEST_F(DiagnosisPage, DoesNotCallUnseenWhatWasLookedForByTheOrderOfThePoses) {
  EXPECT_TRUE(test::has(diagnosis_page(diagnosis_, *cell_), "Would not have shown"));
  for (Measurement& m : diagnosis_.batch.measurements) m.context.direction.clear();
  const std::string page = diagnosis_page(diagnosis_, *cell_);
  EXPECT_FALSE(test::has(page, "Would not have shown"));
  EXPECT_TRUE(test::has(page, "Would not have been named for certain"));
}

TEST_F(DiagnosisPage, SaysOneFigureOfNoiseAndWhatItIs) {
  const std::string page = diagnosis_page(diagnosis_, *cell_);
  EXPECT_TRUE(test::has(
      page,
      "<b>0.0225 mm</b><span>noise, rms: what is left of a position when all that was found"));
  EXPECT_FALSE(test::has(page, "per axis")) << "one figure";
}

TEST_F(DiagnosisPage, AChanceThatIsSmallerThanAnythingKnownIsNoEquality) {
  diagnosis_.unexplained = {true, {"q4"}, 5e-5, 1e-6, ""};
  EXPECT_TRUE(test::has(diagnosis_page(diagnosis_, *cell_),
                        "rms. It changes with the position of joint 4 (p &lt;\u00a010⁻⁶)."));
  diagnosis_.unexplained.p_value = 0.02;
  EXPECT_TRUE(test::has(diagnosis_page(diagnosis_, *cell_),
                        "rms. It changes with the position of joint 4 (p = 0.02)."));
}

TEST_F(DiagnosisPage, DrawsOnlyWhatWasRecorded) {
  for (Measurement& m : diagnosis_.batch.measurements) {
    m.context.time.reset();
    m.context.temperature.reset();
    m.context.direction.clear();
  }
  const auto charts = diagnosis_charts(diagnosis_, *cell_);
  EXPECT_FALSE(charts.contains("temperature"));
  EXPECT_FALSE(charts.contains("direction"));
  EXPECT_FALSE(charts.at("time").at("recorded").get<bool>());
}

TEST_F(DiagnosisPage, HasNoEmptyPlotInARealBrowserHoweverWide) {
  if (!test::has_browser()) GTEST_SKIP() << test::kBrowser << " is not installed";
  for (const int width : {1280, 520}) {
    std::map<std::string, int> seen = seen_by_a_browser(width);
    EXPECT_EQ(seen["errors"], 0) << width;
    EXPECT_LE(seen["page-too-wide"], 0) << width;
    EXPECT_EQ(seen.size(), 2 + 1 + 6 + 1 + 5 + 4 + 1u) << width;  // the two above, then the plots
    seen.erase("errors");
    seen.erase("page-too-wide");
    for (const auto& [canvas, pixels] : seen) EXPECT_GT(pixels, 100) << canvas << " at " << width;
  }
}

TEST_F(DiagnosisPage, WithoutAnyFindingStillOpens) {
  Diagnosis empty;
  empty.sentence = "Nothing beyond the noise.";
  empty.batch.id = "empty";
  empty.sources_before = empty.sources_after = {"base"};
  const std::string page = diagnosis_page(empty, *cell_);
  EXPECT_TRUE(test::has(page, "Nothing beyond the noise."));
  EXPECT_TRUE(test::has(page, "None: every pose fits the others."));
  if (!test::has_browser()) GTEST_SKIP() << test::kBrowser << " is not installed";
  diagnosis_ = empty;
  EXPECT_EQ(seen_by_a_browser(1000)["errors"], 0);
}

}  // namespace
}  // namespace trammel
