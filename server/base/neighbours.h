#pragma once

#include <sys/types.h>

#include <set>
#include <string>
#include <vector>

namespace trammel {

/// An account of a host.
struct Account {
  std::string name;
  uid_t uid = 0;
  std::string shell;
};

/// Other people on a host, by the names of their accounts. They reach everything that listens on
/// 127.0.0.1.
struct Neighbours {
  std::vector<std::string> may_log_in;
  std::vector<std::string> logged_in;  ///< some of them, now
};

/// `present`: who is logged in; `own`: the accounts of the person who asks.
[[nodiscard]] Neighbours neighbours_among(const std::vector<Account>& accounts,
                                          const std::set<uid_t>& present,
                                          const std::set<uid_t>& own);
/// Those of this host, seen from the person who runs this process, with sudo or without.
[[nodiscard]] Neighbours neighbours();

}  // namespace trammel
