#include "server/health/examination/seen_change.h"

#include <algorithm>

namespace trammel::health {

bool is_zero(const SingleCause& cause) {
  return cause.record == &first_searched_by(causes::SearchFamily::kZeroStep) && !cause.any_function;
}

SingleCause unknown_cause() {
  SingleCause unknown;
  unknown.record = &cause_that_stands_for(causes::StandsFor::kNoKnownCause);
  return unknown;
}

void add_rival(const SingleCause& rival, SeenChange& change) {
  const auto same = [&](const SingleCause& known) { return same_cause(known, rival); };
  const bool known = std::any_of(change.could_also_be.begin(), change.could_also_be.end(), same);
  if (!known && !same(change.cause)) change.could_also_be.push_back(rival);
}

void tell_instrument(std::vector<SeenChange>& changed) {
  const auto grew = std::find_if(changed.begin(), changed.end(), [](const SeenChange& change) {
    return change.cause.record->needs.temperature;
  });
  if (grew == changed.end()) return;
  for (const CauseRecord* record : all_causes()) {
    const bool is_rival = std::any_of(
        record->rivals.begin(), record->rivals.end(),
        [&](const causes::Rival& rival) { return rival.cause == grew->cause.record->spelling; });
    if (!is_rival || record->scope != causes::Scope::kSession || record->needs.time) continue;
    for (SeenChange& change : changed) add_rival({record, -1, {}, false}, change);
  }
}

}  // namespace trammel::health
