#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "tests/support/hidden_case.h"

/// Compares the result of a diagnosis with the hidden causes.
namespace trammel::test {

/// A found number beside the hidden one, in the unit that people read.
struct NumberFound {
  std::string name;
  double truth = 0, value = 0, u95 = 0;
  [[nodiscard]] bool inside() const { return std::abs(value - truth) <= u95; }
};

struct Judgement {
  bool detected = false;  ///< says that something is there
  bool exact = false;     ///< names all hidden causes correctly, and nothing else
  int right = 0;          ///< causes hidden that are named
  int right_or_open = 0;  ///< hidden causes that are named or left open by a finding
  int wrong = 0;          ///< causes named that were not hidden
  int open = 0;           ///< findings that leave the choice between several causes open
  bool set_holds_truth =
      false;  ///< the first hidden cause is among those that a finding names or leaves open;
              ///< without a finding, among those said to be inseparable
  bool over_confident = false;   ///< one single name although the causes cannot be separated
  bool unknown_rightly = false;  ///< unknown, of the right joints
  bool unrecorded_rightly =
      false;  ///< for a cause whose column was withheld: it was found, even if doubtful, or its
              ///< dependence is unknown; if it cannot be traced: nothing was found, or unknown
  std::string said;  ///< `backlash:2`, `tool|geometry:d6`, `unknown q4`, `nothing`
  std::vector<NumberFound> numbers;
};

[[nodiscard]] Judgement judge(const Diagnosis& diagnosis, const hidden::HiddenCase& hidden);

}  // namespace trammel::test
