#include "server/diagnose/search/standing.h"

#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/naming.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

bool is_simpler(const Cause& other, const Cause& cause) {
  return is_whole_of(other, cause) || is_simpler_case(other, cause);
}

}  // namespace

Standing::Standing(const SearchResult& found)
    : problem(found.after.model, found.batch, found.after.priors,
              candidate_sources(*found.after.model.cell, found.batch, nullptr)),
      families(make_families(problem)),
      columns(background_columns(problem, found.unnamed)),
      background(columns) {}

Scan Standing::scan(const Chance& chance) const {
  return cause_search::scan(families, {background}, problem.residual(), chance);
}

std::optional<std::size_t> best_named(const std::vector<FamilyPtr>& families,
                                      const Choice& choice) {
  const Scan& seen = choice.seen;
  const auto named = [&](std::size_t f) { return choice.open(f) && families[f]->named(); };
  const auto strongest = seen.strongest(named);
  if (!strongest) return std::nullopt;
  const Cause cause = families[*strongest]->cause(seen.best[*strongest]);
  const auto simpler = seen.strongest([&](std::size_t f) {
    return named(f) && is_simpler(families[f]->cause(seen.best[f]), cause);
  });
  return simpler && seen.score[*simpler] > seen.score[*strongest] - thresholds::kSimplerMargin
             ? simpler
             : strongest;
}

}  // namespace trammel::cause_search
