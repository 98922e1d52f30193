#include "server/report/history.h"

#include <gtest/gtest.h>

#include "tests/support/page_text.h"

namespace trammel {
namespace {

ParameterOnRecord zero_of_joint_3(double value, double u95) {
  return {"link geometry", "q3", "rad", value, u95, true};
}

VersionOnRecord version(int number, ParameterOnRecord parameter) {
  VersionOnRecord one{number, "m" + std::to_string(number), "lt-0" + std::to_string(number),
                      1'700'000'000 + number, 60};
  one.parameters = {std::move(parameter)};
  return one;
}

TEST(History, AParameterThatMovedByMoreThanItsUncertaintyIsNamedWithBothVersions) {
  const CellHistory history{
      "cell-7",
      {version(1, zero_of_joint_3(1.0e-3, 0.03e-3)), version(2, zero_of_joint_3(1.04e-3, 0.03e-3)),
       version(3, zero_of_joint_3(1.2e-3, 0.02e-3))}};
  const std::vector<Moved> moved = moved_parameters(history);
  ASSERT_EQ(moved.size(), 1u) << "from 1 to 2 it stayed within what both leave open";
  EXPECT_EQ(moved[0].from_version, 2);
  EXPECT_EQ(moved[0].to_version, 3);
  EXPECT_NEAR(moved[0].u95, std::hypot(0.03e-3, 0.02e-3), 1e-12);
  EXPECT_TRUE(test::has(history_page(history),
                        "link geometry, q3: 0.0092 ± 0.0021 deg from version 2 to 3"))
      << history_page(history);
  EXPECT_TRUE(test::has(history_page(history),
                        "Versions 1 to 3, trained from 2023-11-14 22:13 to 2023-11-14 22:13 UTC"));
  EXPECT_FALSE(test::has(history_page(history), " rad ")) << "people read degrees";
}

TEST(History, WhereTheTrackerStoodAndWhatNoMeasurementTellsIsNeverSaidToHaveMoved) {
  ParameterOnRecord base = zero_of_joint_3(0, 1e-6), guessed = base;
  base.of_set_up = true;
  guessed.identified = false;
  for (const ParameterOnRecord& one : {base, guessed}) {
    ParameterOnRecord later = one;
    later.value = 1;
    EXPECT_TRUE(moved_parameters({"cell-7", {version(1, one), version(2, later)}}).empty());
  }
}

TEST(History, AVersionWhoseFileIsGoneLeavesAGapAndBreaksNothing) {
  CellHistory history{"cell-7",
                      {version(1, zero_of_joint_3(1e-3, 1e-6)), version(2, zero_of_joint_3(0, 0)),
                       version(3, zero_of_joint_3(2e-3, 1e-6))}};
  history.versions[1].parameters.clear();
  const std::vector<Moved> moved = moved_parameters(history);
  ASSERT_EQ(moved.size(), 1u);
  EXPECT_EQ(moved[0].from_version, 1);
  EXPECT_EQ(history_json(history)["versions"][1]["parameters"].size(), 0u);
}

TEST(History, ThePageShowsTrainingsEventsAndNotesAndWhatComesFromOutsideIsHarmless) {
  CellHistory history{"<b>cell</b>", {version(1, zero_of_joint_3(1e-3, 1e-6))}};
  history.versions[0].in_force = true;
  history.versions[0].notes = {{"changed_between_sessions", Note::Severity::kInfo,
                                "since session lt-02 (pose p1): lost zero in joint 3"}};
  history.trainings = {
      {1'700'000'000, "lt-01", "in_force", "better beyond chance", 0.5e-3, 0.02e-3}};
  history.events = {
      {1'700'000'000, "activate", "version 1", "<script>alert(1)</script>", "cam-2", "version 3",
       "version <4>"},
      {1'700'000'001, "batch", "batch b", "", "cam-2", "", "sha256 " + std::string(64, 'a')}};
  EXPECT_EQ(history_json(history)["versions"][0]["notes"][0]["code"], "changed_between_sessions");
  EXPECT_EQ(history_json(history)["events"][0]["from"], "version 3");
  EXPECT_EQ(history_json(history)["events"][0]["to"], "version <4>");
  const std::string page = history_page(history);
  for (const char* part :
       {"0.5000", "0.0200", "in force: better beyond chance", "lost zero in joint 3", "activate",
        "&lt;b&gt;cell&lt;/b&gt;", "&lt;script&gt;", "2023-11-14 22:13",
        "version 3 → version &lt;4&gt;", "nothing → sha256 aaaaaaaaaaaa…<"})
    EXPECT_TRUE(test::has(page, part)) << part;
  EXPECT_FALSE(test::has(page, "<script>"));
}

TEST(History, TheParametersAreThoseOfTheVersionInForceNotOfTheNewest) {
  CellHistory history{
      "cell-7",
      {version(1, zero_of_joint_3(1e-3, 1e-5)), version(2, zero_of_joint_3(2e-3, 1e-5)),
       version(3, zero_of_joint_3(3e-3, 1e-5))}};
  history.versions[1].in_force = true;
  const std::string page = history_page(history);
  EXPECT_TRUE(test::has(page, "version 2 (in force)"));
  EXPECT_TRUE(test::has(page, "0.1145")) << "2 mrad in deg";
  EXPECT_FALSE(test::has(page, "0.1718")) << "of version 3";
  history.versions[1].in_force = false;
  history.of_files = true;
  EXPECT_TRUE(
      test::has(history_page(history), "Model files do not say which version is in force."));
  EXPECT_TRUE(test::has(history_page(history), "0.1718"));
}

TEST(History, OfNothingIsAPageThatSaysSo) {
  const std::string page = history_page({"cell-7"});
  EXPECT_TRUE(test::has(page, "No version in force is on record."));
  EXPECT_TRUE(moved_parameters({"cell-7"}).empty());
}

}  // namespace
}  // namespace trammel
