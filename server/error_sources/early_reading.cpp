#include "server/error_sources/joint_error.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kShare = 1e-4;  // of the last move, prior

std::vector<Parameter> shares(int joints) {
  std::vector<Parameter> all;
  for (int j = 1; j <= joints; ++j)
    all.push_back({fmt::format("early{}", j), "ppm", 1e6, 0, kShare, 0.0});
  return all;
}

/// Robot or tracker are read before the arm stands still, so each joint lacks a share of its last
/// move: delta q = -e (q - q_before). A servo that settles lacks the same share of every move after
/// the same time. An instrument that begins to average too early sees the same tail of the move. e
/// is not negative, because a joint that overshoots misses no part of its way, and waiting does not
/// bring it back. The cause belongs to the measurement, so it does not act on requests.
class EarlyReading final : public JointError {
 public:
  EarlyReading(const SourceSpec& spec, int joints) : JointError(spec.text, -1, shares(joints)) {}
  const CauseRecord& cause() const override { return causes::early_reading(); }
  std::string explanation() const override {
    return "poses were measured before the arm stood still";
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    std::vector<Term> all;
    if (context.served || !context.before) return all;
    for (int j = 0; j < static_cast<int>(context.q.size()); ++j)
      all.push_back({j, j, (*context.before)(j)-context.q(j)});
    return all;
  }
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  return std::make_shared<EarlyReading>(spec, cell.robot.size());
}

}  // namespace

const CauseRecord& causes::early_reading() {
  static const CauseRecord record = {
      .spelling = "early_reading",
      .plain_name = "reading before standstill",
      .plain_name_of_joint = "",
      .scope = Scope::kSession,
      .lasting = Lasting::kOfTheSession,
      .needs = {.before = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 12},
      .forms = {{"early_reading", make}},
      .rivals = {{.cause = "backlash"}, {.cause = "hysteresis"}, {.cause = "time_lag"}},
      .told_apart_by = remedies::kOtherSpeed,
      .shown_by =
          "poses in the order in which they were measured, with their times, after long and short "
          "moves",
      .action = "wait longer at every pose before it is measured",
      .figures = {{"early", "ppm", "how much of its last move a joint still lacks"}},
  };
  return record;
}

}  // namespace trammel
