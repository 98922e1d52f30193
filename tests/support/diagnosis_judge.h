#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "tests/support/hidden_case.h"

/// How what a diagnosis says stands against what was hidden.
namespace trammel::test {

/// A number that was found beside the one that was hidden, in the unit people read it in.
struct NumberFound {
  std::string name;
  double truth = 0, value = 0, u95 = 0;
  [[nodiscard]] bool inside() const { return std::abs(value - truth) <= u95; }
};

struct Judgement {
  bool detected = false;  ///< says that something is there
  bool exact = false;     ///< names everything that was hidden, rightly, and nothing else
  int right = 0;          ///< causes hidden that are named
  int right_or_open = 0;  ///< causes hidden that are named or among what a finding leaves open
  int wrong = 0;          ///< causes named that were not hidden
  int open = 0;           ///< findings that leave open which of several causes it is
  bool set_holds_truth =
      false;  ///< the first cause hidden is among what a finding names or leaves open; where
              ///< nothing was found, among what is said not to be told apart
  bool over_confident = false;   ///< one single name for what cannot be told
  bool unknown_rightly = false;  ///< unknown, of the right joints
  bool unrecorded_rightly =
      false;  ///< of a cause whose column was withheld: found, however doubtful, or unknown of
              ///< what it depends on; nothing or unknown where it cannot be traced
  std::string said;  ///< `backlash:2`, `tool|geometry:d6`, `unknown q4`, `nothing`
  std::vector<NumberFound> numbers;
};

[[nodiscard]] Judgement judge(const Diagnosis& diagnosis, const hidden::HiddenCase& hidden);

}  // namespace trammel::test
