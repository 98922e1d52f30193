#include "clients/cam/lead_ins.h"

#include <utility>

namespace trammel::cam {

namespace {

constexpr double kWorthALeadIn = 0.9;  // of the error without a lead-in

}  // namespace

bool is_answered(const exchange::CorrectedTarget& item) {
  return item.status == "ok" || item.status == "out_of_domain";
}

void tell_no_lead_in(const LeadInFound& found, std::string& message) {
  if (found.why_not.empty()) return;
  message += (message.empty() ? "no lead-in: " : "; no lead-in: ") + found.why_not;
}

Result<std::vector<LeadInFound>> lead_in_where_needed(
    const LeadInOptions& options, const std::vector<exchange::AskedTarget>& targets,
    const AskTargets& ask, const FindWay& find_way, std::vector<exchange::CorrectedTarget>& items) {
  std::vector<LeadInFound> found(items.size());
  if (options.take_ups.empty()) return found;
  std::vector<std::size_t> places;
  std::vector<exchange::AskedTarget> led;
  for (std::size_t k = 0; k < items.size(); ++k) {
    if (!is_answered(items[k]) || options.near_enough(items[k])) continue;
    found[k] = find_way(k, items[k]);
    if (!found[k].way) continue;
    led.push_back(targets[k]);
    led.back().approach.directions = found[k].way->sides;
    places.push_back(k);
  }
  if (led.empty()) return found;
  const std::vector<exchange::CorrectedTarget> answers = TRY(ask(led));
  for (std::size_t n = 0; n < places.size(); ++n) {
    exchange::CorrectedTarget& item = items[places[n]];
    const bool better = answers[n].status == item.status &&
                        answers[n].error_after_mm < kWorthALeadIn * item.error_after_mm;
    if (better)
      item = answers[n];
    else
      found[places[n]].way.reset();
  }
  return found;
}

}  // namespace trammel::cam
