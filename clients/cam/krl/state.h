#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/cam/krl/statements.h"
#include "clients/cam/krl/tools.h"
#include "clients/cam/krl/variables.h"

/// The settings that lines of a KRL program make for the motions behind them.
namespace trammel::cam::krl {

constexpr double kSpeedUnknown = -1;

/// The settings of the controller when a motion comes.
struct State {
  std::size_t tool = 0, frame = 0;
  std::size_t load = 0;          ///< 0: the tool's own
  std::string fixed_tool;        ///< why the robot does not hold the tool; empty: it does
  std::string sensed;            ///< why a sensor moves the path; empty: none does
  std::string carried;           ///< why a base that is set by itself moves; empty: it stands
  std::string soft;              ///< why a force may move the axes; empty: none may
  std::uint64_t armed = 0;       ///< interrupts that are declared, a bit each
  double speed = kSpeedUnknown;  ///< of the tool, mm/s
  auto operator<=>(const State&) const = default;
};

class Settings {
 public:
  Settings(const std::vector<std::vector<Line>>& lines, const Variables& names, Tools& tools,
           Program& program)
      : lines_(lines), names_(names), tools_(tools), program_(program) {}

  /// The settings that a line makes by itself.
  void set(std::size_t f, std::size_t k, State& state);
  /// Where paths meet, settings that differ between them become unknown.
  void join(State& state, const State& other, const std::string& by);
  /// `WITH $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO)`: only for this motion, or for those of
  /// a spline.
  void apply_with(std::size_t f, std::size_t k, State& state);
  /// True if lines set tool or base for more than one motion.
  [[nodiscard]] bool by_hand() const { return sets_by_hand_; }

 private:
  void apply(const Setting& setting, std::size_t f, std::size_t k, State& state);
  void set_base(const Setting& setting, std::size_t f, std::size_t k, State& state);
  void set_unit(const Tokens& tokens, std::size_t f, std::size_t k, State& state) const;
  void apply_part(const Setting& setting, const std::string& place, State& state);
  void apply_one_with(const Setting& setting, std::size_t f, std::size_t k, State& state);
  void apply_fdat(const std::string& name, std::size_t f, State& state);
  void apply_bas(const Bas& bas, std::size_t f, std::size_t k, State& state);
  void set_sensor(const Tokens& tokens, std::size_t f, std::size_t k, State& state) const;
  void set_soft(const Tokens& tokens, std::size_t f, std::size_t k, State& state) const;
  [[nodiscard]] std::string carried_at(std::size_t f, std::size_t k) const;

  const std::vector<std::vector<Line>>& lines_;
  const Variables& names_;
  Tools& tools_;
  Program& program_;
  bool sets_by_hand_ = false;
};

}  // namespace trammel::cam::krl
