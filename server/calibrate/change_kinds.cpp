#include "server/calibrate/change_kinds.h"

#include <algorithm>
#include <utility>

#include "server/error_sources/spelling.h"

namespace trammel {

using Eigen::Index;

ChangeKinds::ChangeKinds(const PhysicalModel& model, ChangesOf of) : probe_(model) {
  for (const CauseRecord* cause : all_causes()) {
    if (cause->lasting != causes::Lasting::kFromAPose) continue;
    // A value of one session alone, such as where its tracker stood, is no change of the arm.
    if (cause->scope == causes::Scope::kSession && of == ChangesOf::kArm) continue;
    if (cause->scope != causes::Scope::kJoint) add_of_arm(*cause);
    for (int j = 0; cause->scope == causes::Scope::kJoint && j < model.cell->robot.size(); ++j)
      add(*cause, j);
  }
}

void ChangeKinds::add_of_arm(const CauseRecord& cause) {
  const std::size_t tools = probe_.cell->tools.size();
  const bool each = cause.takes_numbers && tools > 1;
  for (std::size_t k = 1; k <= (each ? tools : 1); ++k)
    add(cause, -1, each ? fmt::format("+{}", k) : "");
}

void ChangeKinds::add(const CauseRecord& cause, int joint, const std::string& behind) {
  const std::string spelling =
      joint < 0 ? std::string(cause.spelling) : fmt::format("{}:{}", cause.spelling, joint + 1);
  Result<ErrorSourcePtr> source = make_error_source(spelling + "@1" + behind, *probe_.cell);
  if (!source) return;
  const auto count = static_cast<Index>((*source)->parameters().size());
  const Index first = add_source(probe_, std::move(*source));
  for (Index& at : places_) at += at >= first ? count : 0;
  Index next = 0;
  for (const ChangeKind& kind : kinds_) next += kind.count;
  kinds_.push_back({&cause, spelling, behind, joint, next, count});
  for (Index k = 0; k < count; ++k) places_.push_back(first + k);
}

std::vector<Index> ChangeKinds::own() const {
  std::vector<Index> own;
  for (Index i = 0; i < probe_.values.size(); ++i) {
    if (std::find(places_.begin(), places_.end(), i) == places_.end()) own.push_back(i);
  }
  return own;
}

}  // namespace trammel
