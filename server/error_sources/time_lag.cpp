#include "server/error_sources/joint_error.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

/// The measurement belongs to a moment other than the commanded joints: every joint is where it was `lag` earlier.
class TimeLag final : public JointError {
 public:
  explicit TimeLag(const SourceSpec& spec) : JointError(spec.text, -1, {{"lag", "s", 1, 0, 0.05}}) {}
  std::string explanation() const override { return "joints and measurement are not of the same moment"; }
  ContextNeeds needs() const override { return {.velocity = true}; }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    std::vector<Term> all;
    if (!context.velocity) return all;
    for (int j = 0; j < static_cast<int>(context.q.size()); ++j) all.push_back({j, 0, -(*context.velocity)(j)});
    return all;
  }
};

}  // namespace

Result<ErrorSourcePtr> make_time_lag(const SourceSpec& spec, const Cell&) { return std::make_shared<TimeLag>(spec); }

}  // namespace trammel
