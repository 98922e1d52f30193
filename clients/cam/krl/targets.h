#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/krl/variables.h"
#include "clients/cam/sites.h"

/// The targets where the motions of a KRL program go.
namespace trammel::cam::krl {

constexpr int kDecimals = 3;  ///< for numbers that the program did not write

class Targets {
 public:
  Targets(const std::vector<std::vector<Line>>& lines, const Variables& names,
          const ReadOptions& options, Program& program)
      : lines_(lines), names_(names), options_(options), program_(program) {}

  /// Adds the place to which a motion goes.
  void add(const Assigned& at) { places_[{at.file, at.operands[0].begin}] = at; }
  /// Records other statements that read the rewritten targets.
  void note_readings(std::size_t f);
  [[nodiscard]] std::string describe(const Site& site, ProgramTarget& target) const;
  /// Positions of data lists that nothing moves to.
  void list_unused();
  /// The operand with the status, turns and external axes; empty if it is not known.
  [[nodiscard]] const Value* last_of(const std::vector<Value>& operands, std::size_t file) const;
  /// Status, turns and axes as text behind six numbers: `,S 2,T 10`.
  [[nodiscard]] static std::string rest_of(const Value* value);

 private:
  [[nodiscard]] std::string describe_axes(const Value& value, ProgramTarget& target) const;
  void rewrite(const Value& value, const std::array<const char*, 6>& fields,
               ProgramTarget& target) const;
  void fold(const Assigned& place, const Value* last, ProgramTarget& target) const;
  static void note_rest(const Value& value, ProgramTarget& target);
  void note_reading(std::size_t f, std::size_t k, std::size_t at);
  void add_reading(std::size_t f, std::size_t k, std::size_t at, bool number,
                   const Assigned& source);

  const std::vector<std::vector<Line>>& lines_;
  const Variables& names_;
  const ReadOptions& options_;
  Program& program_;
  std::map<std::pair<std::size_t, std::size_t>, Assigned> places_;  ///< by file and first byte
  std::map<std::pair<std::size_t, std::size_t>, std::string>
      read_;                                        ///< why the numbers at a place must stay
  std::map<std::string, const Assigned*> targets_;  ///< by name, of all files
  std::set<std::string> words_of_targets_;
};

}  // namespace trammel::cam::krl
