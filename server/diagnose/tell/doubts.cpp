#include "server/diagnose/tell/doubts.h"

#include <algorithm>

#include "server/diagnose/search/naming.h"
#include "server/diagnose/tell/wording.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

bool contains(const std::vector<Cause>& causes, const Cause& cause) {
  return std::find(causes.begin(), causes.end(), cause) != causes.end();
}

void add(std::vector<Cause>& causes, const Cause& cause) {
  if (!contains(causes, cause)) causes.push_back(cause);
}

bool is_dwarfed(double effect_rms, const Unexplained& unexplained) {
  return unexplained.present && effect_rms <= thresholds::kDwarfed * unexplained.rms;
}

/// Whether a gear of `joint` is one of too many orders to be believed, or stands beside a map.
bool has_no_single_order(const Cause& cause, const std::vector<Cause>& found) {
  const auto at_joint = [&](const char* name) {
    return std::count_if(found.begin(), found.end(),
                         [&](const Cause& other) { return other.cause == name && other.joint == cause.joint; });
  };
  return cause.cause == "gear_transmission" &&
         (at_joint("joint_map") > 0 || at_joint("gear_transmission") > thresholds::kMostOrders);
}

/// What a cause that was found by a surrogate may be instead. It is never sure.
void add_rivals_of_surrogate(const Cause& cause, std::vector<Cause>& rivals) {
  if (cause.cause == "backlash") return add(rivals, {"unknown", cause.joint});
  if (cause.cause == "thermal_growth") add(rivals, {"tracker_drift"});
  if (rivals.empty()) rivals.push_back({"unknown"});
}

std::string what_to_record(const Cause& cause, const Surrogates& surrogates) {
  if (cause.cause == "backlash")
    return "needs the approach direction of each pose (dir columns): it was taken from the order of the rows";
  return fmt::format(
      "record {} with every pose, and measure reference reflectors in between: what was not recorded was taken from "
      "the order of the rows",
      !surrogates.temperature ? "the time (time_s)"
      : surrogates.time       ? "temperature and time (temperature_c, time_s)"
                              : "the temperature (temperature_c)");
}

}  // namespace

Judgement judge(const Cause& cause, double effect_rms, const std::vector<Cause>& rivals, const Beside& beside) {
  const Cause map{"joint_map", cause.joint};
  const bool by_surrogate = is_by_surrogate(beside.surrogates, cause);
  const bool dwarfed = is_dwarfed(effect_rms, beside.unexplained);
  const bool no_single_order = has_no_single_order(cause, beside.found) && !contains(rivals, map);

  std::vector<Cause> could_also_be = rivals;
  for (const Cause& rival : untestable_rivals(cause, beside.recorded)) add(could_also_be, rival);
  if (by_surrogate) add_rivals_of_surrogate(cause, could_also_be);
  if (dwarfed) could_also_be.push_back({"unknown"});
  if (no_single_order) could_also_be.push_back(map);

  const auto action = [&]() -> std::string {
    if (no_single_order)
      return fmt::format("measure more poses over the range of joint {}: its error has no single order",
                         cause.joint + 1);
    if (dwarfed) return "find first what is unknown here: it is several times larger";
    if (by_surrogate) return what_to_record(cause, beside.surrogates);
    return action_for(cause, rivals);
  };
  return {std::move(could_also_be), action()};
}

}  // namespace trammel::cause_search
