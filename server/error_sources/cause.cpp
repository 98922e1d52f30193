#include "server/error_sources/cause.h"

namespace trammel {

std::string plain_name(const CauseRecord& record, int joint) {
  if (joint < 0 || record.plain_name_of_joint.empty()) return std::string(record.plain_name);
  return fmt::format(fmt::runtime(record.plain_name_of_joint), joint + 1);
}

}  // namespace trammel
