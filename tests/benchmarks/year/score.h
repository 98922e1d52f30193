#pragma once

#include <string>
#include <vector>

/// The score of a year, by the truth.
namespace trammel::year {

/// An arm in a week; m, rms.
struct WeekOfArm {
  std::string cell;
  int week = 0;
  double holes = 0;     ///< of the holes that the service corrected without a warning
  double in_force = 0;  ///< of the model in force
  double oracle = 0;    ///< of a model of a fresh batch of the arm as it is
  double without_physics =
      0;  ///< of a Gaussian process on the drawing, from the batches that were measured
  bool warned = false;  ///< nobody would have drilled
};

enum class Told {
  kNamed,
  kOpen,
  kMissed
};  ///< kOpen: seen as a change, or as something that cannot be told

struct EventOfYear {
  std::string cell;
  int week = 0, told_in = 0;
  std::string what;
  bool slow = false;
  Told told = Told::kMissed;
};

struct YearScore {
  std::vector<WeekOfArm> weeks;
  std::vector<EventOfYear> events;
  int holes = 0, holes_warned = 0, out = 0, out_without_warning = 0;  ///< out: out of tolerance
  int checks = 0, false_alarms = 0, changes_told = 0, wrong_names = 0;
  int steps = 0,
      worse = 0;  ///< models that came in force; of them with more than 1.15 times the error before
  int bad_batches = 0, bad_in_force = 0;
  int kills = 0, jobs_lost = 0, asked = 0, lost = 0;
};

/// The year as a page that people look at.
[[nodiscard]] std::string year_page(const YearScore& score);

}  // namespace trammel::year
