#pragma once

#include <map>
#include <optional>
#include <string>

#include "tests/benchmarks/year/score.h"
#include "tests/benchmarks/year/upkeep.h"

namespace trammel::year {

/// An arm, everybody who works on it, and what they would have without the service.
class CellYear {
 public:
  CellYear(const Arm& arm, client::Session& session, bool talk);

  /// Its first batch, from which there is a model.
  void begin();
  /// Monday's check, what follows from it, and the week's holes.
  void live(int week, YearScore& score);
  /// Somebody sends a batch that never should have been sent.
  void take(const BadBatch& bad, int week, YearScore& score);
  void finish(YearScore& score) const;

  [[nodiscard]] Metrologist& metrologist() { return metrologist_; }
  [[nodiscard]] const Arm& arm() const { return arm_; }

 private:
  void judge(const Said& said, int week, YearScore& score);
  void judge_name(const std::vector<Named>& names, int week, YearScore& score);
  [[nodiscard]] bool is_as_modelled(int week) const;
  void measure(int week, int poses);
  /// Counts the effect of a new model in force on the true error.
  void count_step(double before, int version_before, int week, YearScore& score);
  void drill(int week, YearScore& score);
  [[nodiscard]] double oracle_error(int week);
  void tell(int week, const std::string& what) const;

  const Arm& arm_;
  bool talk_;
  Metrologist metrologist_;
  Driller driller_;
  bool trusted_ = true;
  int lived_ = 0;     // the last week
  int modelled_ = 0;  // week of the last batch that went in force
  std::optional<CompensatedModel> oracle_, without_physics_;
  std::map<std::string, EventOfYear> told_;
};

}  // namespace trammel::year
