#include "server/report/session_changes_json.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

SessionChange lost_zero() {
  SessionChange change;
  change.source = "joint_slip:3@121";
  change.cause = "joint_slip";
  change.joint = 3;
  change.session_id = "day-<3>";
  change.pose_id = "p1";
  change.sizes = {{"slip3", "deg", -0.2, 0.004}};
  change.could_also_be = {"tool_changed@121"};
  return change;
}

TEST(SessionChanges, AreTheSameForProgramsAndOnThePage) {
  const auto json = session_changes_json({lost_zero()}).at(0);
  EXPECT_EQ(json.at("cause"), "joint_slip");
  EXPECT_EQ(json.at("joint"), 3);
  EXPECT_EQ(json.at("since").at("session_id"), "day-<3>");
  EXPECT_EQ(json.at("parameters").at("slip3").at("u95"), 0.004);
  EXPECT_EQ(json.at("could_also_be").at(0).at("cause"), "tool_changed");
  EXPECT_TRUE(json.at("could_also_be").at(0).at("joint").is_null());
  const std::string html = session_changes_html({lost_zero()});
  for (const char* part : {"day-&lt;3&gt; (pose p1)", "lost zero in joint 3", "-0.2000", "0.0040",
                           "deg", "the tool was changed"})
    EXPECT_NE(html.find(part), std::string::npos) << part << " is not in " << html;
  EXPECT_EQ(session_changes_html({}), "");
}

TEST(SessionChanges, SayWhatTheyRestOn) {
  SessionChange change = lost_zero();
  EXPECT_EQ(sentence(change).find("order"), std::string::npos) << sentence(change);
  EXPECT_NE(sentence(change).find("ambiguous: it could also be"), std::string::npos)
      << sentence(change);
  change.rests_on_order = true;
  EXPECT_NE(sentence(change).find("rests on the order"), std::string::npos) << sentence(change);
  EXPECT_TRUE(session_changes_json({change}).at(0).at("rests_on_order").get<bool>());
}

}  // namespace
}  // namespace trammel
