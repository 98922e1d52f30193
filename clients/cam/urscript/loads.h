#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "clients/cam/program.h"
#include "clients/cam/scan.h"

namespace trammel::cam::urscript {

/// What `set_payload` said.
struct Load {
  std::string name;
  std::optional<StatedLoad> load;
  std::string why_not;
};

/// The loads that a script sets, each once. Number 0: none was said.
class Loads {
 public:
  [[nodiscard]] const Load& operator[](std::size_t number) const { return all_[number]; }
  /// The number of this load.
  std::size_t add(Load load);
  /// `set_payload(40, [0, 0, 0.1])` and its like: all that the flange carries, kg and m. `at`:
  /// where its name stands. `before`: what was set until then. `file`: the name of the script.
  std::size_t set(const std::vector<Piece>& pieces, std::size_t at, std::size_t before,
                  const std::string& file);

 private:
  std::vector<Load> all_ = std::vector<Load>(1);
};

}  // namespace trammel::cam::urscript
