#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"
#include "clients/cam/urscript/values.h"

namespace trammel::cam::urscript {

/// The payload that `set_payload` stated.
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
  /// Reads `set_payload(40, [0, 0, 0.1])` and similar calls: the whole load of the flange, kg and
  /// m. `at`: the place of the name. `before`: the load until then. `file`: the name of the script.
  std::size_t set(const Tokens& tokens, std::size_t at, std::size_t before,
                  const std::string& file);

 private:
  std::vector<Load> all_ = std::vector<Load>(1);
};

/// The tools of a script, each once among those of the program.
class Tools {
 public:
  Tools(Program& program, const ReadOptions& options) : program_(program), options_(options) {}

  /// Before any is set.
  std::size_t not_set();
  /// `set_tcp(p[...])`, or why its pose is not known.
  std::size_t set(const Told<Pose>& X_FT, const std::string& file, int line);
  std::size_t unknown(const std::string& why);
  /// The motion's tool with its load.
  std::size_t carrying(std::size_t tool, std::size_t load);

  [[nodiscard]] Loads& loads() { return loads_; }
  [[nodiscard]] bool is_known(std::size_t tool) const {
    return program_.tools[tool].why_not.empty();
  }

 private:
  std::size_t add(ProgramTool tool);

  Program& program_;
  const ReadOptions& options_;
  Loads loads_;
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> carrying_;
};

}  // namespace trammel::cam::urscript
