#include "server/error_sources/cause.h"

#include <algorithm>

namespace trammel {

const causes::Rival* whole_of(const CauseRecord& record) {
  const auto whole =
      std::find_if(record.rivals.begin(), record.rivals.end(), [](const causes::Rival& rival) {
        return rival.likeness == causes::Likeness::kFromTheFirstPose;
      });
  return whole == record.rivals.end() ? nullptr : &*whole;
}

std::string parameter_of(const causes::Rival& rival, int joint) {
  return fmt::format(fmt::runtime(rival.parameter), joint + 1);
}

std::string plain_name(const CauseRecord& record, int joint) {
  if (joint < 0 || record.plain_name_of_joint.empty()) return std::string(record.plain_name);
  return fmt::format(fmt::runtime(record.plain_name_of_joint), joint + 1);
}

}  // namespace trammel
