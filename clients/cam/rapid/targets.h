#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "clients/cam/keep.h"
#include "clients/cam/program.h"
#include "clients/cam/rapid/interpreter.h"

/// The targets where the motions of a RAPID program go.
namespace trammel::cam::rapid {

/// A motion to a place, with its tool and its frame.
struct Use {
  std::size_t tool = 0, frame = 0;
  const Instruction* motion = nullptr;
  std::size_t module = 0;
  std::size_t move = 0;  ///< of Program::moves
  Data data;
  std::string external_displaced =
      {};  ///< why external axes may be at other values than in the target; empty: they are not
};

/// The bytes of a target, and their uses.
struct Site {
  std::size_t module = 0;
  std::size_t statement = 0;  ///< first byte of its statement
  std::string name;
  std::vector<Use> uses;
  bool joints = false;
  bool in_motion = false;  ///< stands in the motion itself
};

/// Fills targets in.
class Targets {
 public:
  Targets(const Interpreter& meaning, const ReadOptions& options, const Program& program)
      : meaning_(meaning), options_(options), program_(program) {}

  Told<void> read_joints(const Data& data, ProgramTarget& target);
  [[nodiscard]] Told<void> read_target(const Data& data, const std::vector<const Use*>& uses,
                                       const Data* place, ProgramTarget& target) const;
  /// The same motion to another place in its configuration. Empty if the motion does not stop at
  /// its target, or is not alone in its line.
  [[nodiscard]] std::vector<NewLine> another(const Use& use, bool joints) const;
  /// The line above the statement that keeps what was folded.
  void note_original(const Site& site, const Data& place, ProgramTarget& target) const;

 private:
  static void note_external(const std::array<double, 6>& external, ProgramTarget& target);
  static Configuration configuration_of(const std::array<double, 4>& conf);
  void rewrite(const Expression& expression, const Scope& scope, std::size_t first,
               std::size_t count, int decimals, ProgramTarget& target) const;
  static void rewrite_whole(const Expression& expression, const TargetValue& value,
                            ProgramTarget& target);
  static void write_whole(const TargetValue& value, NewText& whole);

  const Interpreter& meaning_;
  const ReadOptions& options_;
  const Program& program_;
};

}  // namespace trammel::cam::rapid
