#include "server/diagnose/beginning.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"

namespace trammel {
namespace {

DiagnoseOptions quick() {
  DiagnoseOptions options;
  options.draws = 200;
  options.next_poses = 0;
  options.recovery = false;
  return options;
}

/// Findings of what was hidden, and how many of them hold the pose at which it began.
struct Held {
  int found = 0, held = 0, poses = 0;
};

Held held(const char* kind, double lambda) {
  Held held;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const hidden::HiddenCase hidden = hidden::hide({.kind = kind, .seed = seed, .lambda = lambda, .poses = 100});
    const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, quick()));
    const std::string truth = fmt::format("p{}", hidden.truth.causes[0].first + 1);
    for (const Finding& finding : diagnosis.findings) {
      if (finding.cause.cause != kind) continue;
      ++held.found;
      held.poses += static_cast<int>(finding.may_begin_at.size());
      const auto is = [](const std::string& id) { return [&id](const auto& place) { return place.pose_id == id; }; };
      const auto& places = finding.may_begin_at;
      held.held += std::any_of(places.begin(), places.end(), is(truth)) ? 1 : 0;
      EXPECT_TRUE(std::any_of(places.begin(), places.end(), is(finding.cause.pose_id)));
    }
  }
  return held;
}

TEST(Beginning, IsAmongThosePossibleNearlyAlways) {
  int found = 0, right = 0;
  for (const char* kind : {"tracker_moved", "joint_slip", "tool_changed"}) {
    const Held one = held(kind, 80);
    found += one.found;
    right += one.held;
    EXPECT_LT(one.poses, 20 * one.found) << kind << ": a set of everything says nothing";
  }
  EXPECT_GE(found, 10);
  EXPECT_GE(right, found - 1) << "of " << found;
}

TEST(Beginning, OfALargeStepIsOnePoseOrTwo) {
  const Held one = held("tracker_moved", 20000);
  EXPECT_EQ(one.held, one.found);
  EXPECT_LE(one.poses, 2 * one.found);
}

}  // namespace
}  // namespace trammel
