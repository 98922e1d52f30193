#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "clients/cam/rapid/interpreter.h"
#include "clients/cam/rapid/order.h"
#include "clients/cam/rapid/tools.h"

/// The settings that instructions and assignments of RAPID make for the motions behind them.
namespace trammel::cam::rapid {

/// Whether the controller goes to the configuration of a target, or stays as near as possible.
enum class Confs { kOn, kOff, kUndecided };

/// The settings where a motion begins.
struct State {
  std::size_t load = 0;                ///< as Tools numbers them; 0: the tool's own
  std::size_t displaced = 0;           ///< as Setting has the reason; 0: none
  std::size_t external_displaced = 0;  ///< the same
  std::array<std::size_t, 4>
      given_way{};           ///< likewise, for instructions that take the arm away from its motions
  std::size_t settings = 0;  ///< as Setting numbers them
  Confs lines = Confs::kOn, axes = Confs::kOn;  ///< ConfL, ConfJ
  bool operator==(const State&) const = default;
};

class Setting {
 public:
  Setting(const std::vector<Module>& modules, Interpreter& meaning, Tools& tools)
      : modules_(modules), meaning_(meaning), tools_(tools) {}

  /// If a routine ends with displaced targets, all motions may be displaced.
  void note_displacements();
  void set(const Place& place, State& state);
  void join(State& state, const State& other, const std::string& by);
  /// Why all motions may be displaced; empty: they are not.
  [[nodiscard]] const std::string& open_displacement() const { return open_displacement_; }
  [[nodiscard]] const std::string& displacement(std::size_t number) const {
    return displacements_[number];
  }
  [[nodiscard]] const Settings& settings(std::size_t number) const { return *settings_[number]; }

 private:
  static bool displaces(const Instruction& instruction);
  static bool displaces_external(const Instruction& instruction);
  [[nodiscard]] std::string displacement(std::size_t module, const Instruction& instruction) const;
  std::size_t known_displacement(const std::string& why);
  std::size_t known_settings(Settings settings);
  static Settings on_both_ways(const Settings& one, const Settings& other);
  static Confs confs_of(const Instruction& instruction);

  const std::vector<Module>& modules_;
  Interpreter& meaning_;
  Tools& tools_;
  std::string open_displacement_;
  std::vector<std::string> displacements_ = std::vector<std::string>(1);
  std::map<Settings, std::size_t> settings_at_ = {{{}, 0}};
  std::vector<const Settings*> settings_ = {&settings_at_.begin()->first};
};

}  // namespace trammel::cam::rapid
