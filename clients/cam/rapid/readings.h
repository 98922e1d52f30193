#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"
#include "clients/cam/rapid/interpreter.h"

/// The statements of a RAPID program that read its targets, other than the motions to them.
namespace trammel::cam::rapid {

class Readings {
 public:
  Readings(const std::vector<Module>& modules, Interpreter& meaning, Program& program)
      : modules_(modules), meaning_(meaning), program_(program) {}

  /// Records that a motion goes to the target with this first byte.
  void add_place(std::size_t module, std::size_t begin) { places_.emplace(module, begin); }
  /// Names in the targets of motions are treated there.
  void note_names(const Expression& expression);
  /// When all places are known.
  void find();
  /// Why the bytes at a place must stay as they are; empty: they need not.
  [[nodiscard]] std::string why_kept(const std::pair<std::size_t, std::size_t>& place,
                                     const Declaration* declared) const;
  /// Declared targets that nothing moves to.
  void list_unused();

 private:
  static std::size_t old_points(const std::string& name);
  void note_references();
  void note_references(const std::string& name, const std::string& spelled,
                       const std::vector<Expression>& arguments, const Scope& at,
                       std::set<const Declaration*>& measured);
  void note_references(const Expression& expression, const Scope& at,
                       std::set<const Declaration*>& measured);
  void note_reference(const Expression& point, const Scope& at, const std::string& by, int line,
                      std::set<const Declaration*>& measured);
  void note_readings(std::size_t m);
  static const Expression* root_of(const Expression& target);
  std::string root_text(const Expression& target, std::size_t m);
  void note_readings(std::size_t m, const Span& span, int routine, int line, const std::string& by);
  void note_reading(const Scope& at, const std::string& spelled, int dots, int line,
                    const std::string& by);
  void add_reading(const Data& data, const Scope& at, const std::string& spelled, int dots,
                   int line, const std::string& by);
  void note_unknown(std::size_t m, const Instruction& instruction);
  const Scope& own(std::size_t module) {
    return own_.emplace(module, Scope{module, -1}).first->second;
  }

  const std::vector<Module>& modules_;
  Interpreter& meaning_;
  Program& program_;
  std::set<std::pair<std::size_t, std::size_t>> places_;
  std::map<std::size_t, Scope> own_;
  std::set<std::string> named_;
  bool calls_routine_ = false, moves_ = false;
  std::map<const Declaration*, std::string> read_;  ///< why the numbers of a target must stay
  std::map<const Declaration*, const Instruction*>
      unknown_;  ///< calls that get a target and may be motions
  struct Reference {
    std::size_t end = 0;
    std::string why;
  };
  std::map<std::pair<std::size_t, std::size_t>, Reference>
      references_;  ///< the same, by module and first byte
};

}  // namespace trammel::cam::rapid
