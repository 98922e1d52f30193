#pragma once

#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "clients/cam/krl/calls.h"
#include "clients/cam/krl/state.h"
#include "clients/cam/krl/statements.h"
#include "clients/cam/krl/targets.h"

/// The targets of the motions of a KRL program, with the settings at each motion.
namespace trammel::cam::krl {

class Motions {
 public:
  Motions(const std::vector<std::vector<Line>>& lines, const Routines& routines,
          const Variables& names, Tools& tools, Settings& settings, Targets& targets,
          Program& program)
      : lines_(lines),
        routines_(routines),
        names_(names),
        tools_(tools),
        settings_(settings),
        targets_(targets),
        program_(program) {}

  /// The head of the spline block that a line is in.
  void note_spline(std::size_t f, std::size_t k, std::size_t head) { splines_[{f, k}] = head; }
  /// Records that a line, which need not be a motion, is reached with these settings.
  void reach(std::size_t f, std::size_t k, State state);
  /// Call it last: it makes the targets, and the possible last motions before each. `resumes`: an
  /// interrupt may end the routine that it interrupted.
  void finish(bool resumes);
  /// A sentence on arcs that end by their angle.
  void note_angles();

 private:
  using Place = std::pair<std::size_t, std::size_t>;  ///< file and line

  void leave_at(std::size_t f, std::size_t k, const std::string& name, const std::string& why);
  std::size_t move_at(std::size_t f, std::size_t k);
  void use(std::size_t f, std::size_t k, const std::vector<Value>& operands, const State& state);
  [[nodiscard]] std::string home_at(std::size_t f, std::size_t k, const std::string& name) const;
  void use_any(std::size_t f, std::size_t k, const std::string& wanted, const std::string& name,
               const SiteUse& use);
  void use_named(std::size_t f, std::size_t k, const std::string& wanted, const std::string& name,
                 const SiteUse& use);
  void note_axes(const Value& value, std::size_t move);
  void find_repeatable();
  void find_order(bool resumes);
  void follow(const Place& place, const std::set<std::size_t>& before);
  [[nodiscard]] std::string text_of(std::size_t f, const Span& span) const;

  const std::vector<std::vector<Line>>& lines_;
  const Routines& routines_;
  const Variables& names_;
  Tools& tools_;
  Settings& settings_;
  Targets& targets_;
  Program& program_;
  Sites sites_;
  std::map<Place, std::size_t> splines_, moves_;
  std::set<std::tuple<std::size_t, int, std::string>> left_;
  std::set<std::pair<std::size_t, int>> by_angle_;   ///< arcs, by file and line
  std::map<std::size_t, std::vector<double>> axes_;  ///< deg, that motions command
};

}  // namespace trammel::cam::krl
