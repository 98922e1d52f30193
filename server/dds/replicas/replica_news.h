#pragma once

#include <functional>
#include <string>

namespace trammel {

/// Something that a person should know of the replicas, for the log.
struct ReplicaNews {
  const char* event = "";  ///< `replica_role`, `replica_trouble`, `replica_trouble_over`, `replica_batch_not_copied`
  std::string what;        ///< one sentence
  bool is_good = false;    ///< nobody need do anything
};
using ReplicaListener = std::function<void(const ReplicaNews&)>;

/// Why this server changes nothing now.
struct ChangesElsewhere {
  std::string writer;  ///< who does; empty: nobody is there
  std::string why;     ///< one clause
};

}  // namespace trammel
