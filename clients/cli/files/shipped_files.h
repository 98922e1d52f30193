#pragma once

#include <string>
#include <vector>

namespace trammel::cli {

/// A file that ships: beside the installed program, or in the tree that it was built from.
[[nodiscard]] std::string shipped_file(const std::string& name);
/// The robot files that ship, sorted.
[[nodiscard]] std::vector<std::string> shipped_robots();

}  // namespace trammel::cli
