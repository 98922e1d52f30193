#pragma once

#include <string>
#include <string_view>
#include <vector>

/// The hint that ends the message of an unreachable target: it lists the branches (conf) that would
/// reach the target. `joint 5 would be at 121.3 deg, limit 120; conf 1, 3 or 7 would reach it`. The
/// wire and files carry the branches only in this form, so it is written and read here alone.
namespace trammel {

/// The parts of a message. Without branches `before` is the whole message.
struct BranchHint {
  std::string before;
  std::vector<int> branches;
};

/// `before` with the branches at its end; `before` alone without any.
[[nodiscard]] std::string with_branch_hint(const std::string& before,
                                           const std::vector<int>& branches);
/// The reverse.
[[nodiscard]] BranchHint branch_hint_in(std::string_view message);

/// `conf 1, 3 or 7`. `branches` is not empty.
[[nodiscard]] std::string branch_list(const std::vector<int>& branches);

}  // namespace trammel
