#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// The origin of the millimetres: the error of an arm from its drawing to the remaining residual,
/// with one line for each thing that a person can point at. server/compensate/budget/README.md
/// derives the arithmetic.
namespace trammel {

/// The kind of a line of the budget.
enum class LineKind {
  kBase,
  kJointZero,
  kLength,
  kTwist,
  kTool,
  kJointCompliance,
  kCause,       ///< a further cause of the catalogue
  kLearned,     ///< the bias
  kTogether,    ///< the joint effect of the lines beyond the sum of the single ones
  kUntold,      ///< combinations that these poses do not determine
  kRest,        ///< the model's residual beyond the noise of the instrument
  kInstrument,  ///< the stated noise of the instrument
};
/// The spelling in JSON and on the wire: `joint_zero`.
[[nodiscard]] std::string_view to_string(LineKind kind);
/// The inverse of it; empty if no kind has that spelling.
[[nodiscard]] std::optional<LineKind> line_kind(std::string_view spelled);

/// A number of a line, in the unit that people read.
struct BudgetNumber {
  std::string name;  ///< the model's name: `q4`
  double value = 0;
  double u95 = 0;  ///< U(k = 2)
  std::string unit;
};

/// One physical thing on which a person can put a finger.
struct BudgetLine {
  std::string line;  ///< `zero:4`, `length:2`, `twist:3`, `base`, `tool`, `compliance:2`, else as
                     ///< in a cell file
  LineKind kind = LineKind::kCause;
  std::string cause;  ///< of a kCause, its spelling: `gear_transmission`
  int joint = -1;     ///< 0-based; -1: of no single joint
  std::string name;   ///< for people: `the zero of joint 4`
  std::optional<BudgetNumber>
      value;  ///< the one number of the line, the largest of a link; a distance for a place
  std::vector<BudgetNumber> numbers;  ///< all numbers of a line with several
  double alone_rms = 0;               ///< m, at the poses: the effect of the line by itself
  double alone_max = 0;               ///< m
  double share = 0;          ///< of the mean square error; may be negative; all lines add to 1
  double left_if_right = 0;  ///< m rms: the remaining error if only this line were put right
  std::optional<double> times_usual;  ///< the value over the usual size for arms of this kind
  std::vector<std::string>
      with;            ///< lines that the poses cannot distinguish from it; they are counted here
  std::string action;  ///< the repair; empty: nothing stands out
  std::string since_session;  ///< for a change between sessions: the first session with it; else
                              ///< empty
  [[nodiscard]] std::string cause_or_kind() const;
};

/// All lines, the largest share first; `kTogether`, `kUntold`, `kRest` and `kInstrument` stand
/// last.
struct BudgetView {
  double error_rms = 0;  ///< m, of the error that the shares are of
  std::vector<BudgetLine> lines;
};

/// The error that is left after this repair and all before it, with base and tool frames touched
/// again each time.
struct PutRight {
  std::string step;     ///< `nothing`, `frames`, `zeros`, `lengths`, `loads`, `trammel`
  std::string name;     ///< for people
  double left_rms = 0;  ///< m
};

/// The error budget of a model at measured poses.
struct ErrorBudget {
  int poses = 0;
  BudgetView as_it_stands;
  /// The view of the error that remains after touching base and tool frames: the best fit of both
  /// to the error is removed from it and from every line. Lines of frames are absent here.
  BudgetView beyond_frames;
  std::vector<PutRight> put_right;  ///< one after the other
  /// The changes of the arm between sessions, each line at the poses where it acts. `as_it_stands`
  /// contains the same lines at all poses. Empty if nothing changed.
  std::vector<BudgetLine> between_sessions;

  [[nodiscard]] const BudgetLine* line(std::string_view name) const;
};

}  // namespace trammel
