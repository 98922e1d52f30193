#include "server/robot/branch_hint.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

using Branches = std::vector<int>;

TEST(BranchHint, SaysTheBranchesBehindTheReason) {
  EXPECT_EQ(with_branch_hint("joint 5 would be at 121.3 deg, limit 120", {1, 3, 7}),
            "joint 5 would be at 121.3 deg, limit 120; conf 1, 3 or 7 would reach it");
  EXPECT_EQ(with_branch_hint("too far", {}), "too far");
}

TEST(BranchHint, IsReadAsItWasWritten) {
  for (const Branches& branches : {Branches{}, {0}, {2, 5}, {0, 1, 2, 3, 4, 5, 6, 7}}) {
    const std::string before =
        "joint 2 would be at 95 deg, limit 90; joint 5 would be at 121 deg, limit 120";
    const BranchHint read = branch_hint_in(with_branch_hint(before, branches));
    EXPECT_EQ(read.before, before);
    EXPECT_EQ(read.branches, branches);
  }
}

TEST(BranchHint, LeavesWhatOnlyLooksLikeOneInTheMessage) {
  for (const char* message :
       {"", "; ", "conf 1 would reach it", "tool; conf ", "tool; conf x would reach it",
        "tool; conf 1, 3 would", "tool; conf 1 would reach it, with luck",
        "tool; conf 99999999999999999999 would reach it"}) {
    EXPECT_EQ(branch_hint_in(message).before, message);
    EXPECT_TRUE(branch_hint_in(message).branches.empty()) << message;
  }
}

}  // namespace
}  // namespace trammel
