#include "server/error_sources/other_joint.h"

#include <cmath>

namespace trammel {

Result<int> other_joint(const SourceSpec& spec, const Chain& chain) {
  const double told = spec.at.empty() ? (spec.joint > 0 ? spec.joint : 2) : spec.at[0];
  if (spec.at.size() > 1 || told != std::floor(told) || told > chain.size() ||
      told == spec.joint + 1) {
    return failure(ErrorCode::kUsage,
                   "error source '{}': expected {}:{}@joint with another joint of 1 to {}",
                   spec.text, spec.name, spec.joint + 1, chain.size());
  }
  const int other = static_cast<int>(told) - 1;
  for (const int joint : {spec.joint, other}) {
    if (chain.joint(joint).type != JointType::kRevolute)
      return refused("error source '{}': joint {} does not turn", spec.text, joint + 1);
  }
  return other;
}

}  // namespace trammel
