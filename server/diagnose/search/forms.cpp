#include "server/diagnose/search/forms.h"

#include <algorithm>

#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/search/held_out.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr int kFewestHarmonics = 4;  // of a map: the smallest number that the search tries

/// The spellings of a source between which poses held out decide: forms of a cause, fewer harmonics
/// of a map.
std::vector<std::string> spellings(const std::string& source, const Cell& cell) {
  if (cause_spelled(source).search != causes::SearchFamily::kMap) return alternatives(source, cell);
  const std::size_t at = source.find('@');
  std::vector<std::string> all;
  for (int harmonics = std::stoi(source.substr(at + 1)); harmonics >= kFewestHarmonics;
       harmonics /= 2)
    all.push_back(source.substr(0, at + 1) + std::to_string(harmonics));
  return all;
}

/// The sources of `model` that could have another form.
std::vector<std::string> forms_in(const PhysicalModel& model) {
  std::vector<std::string> forms;
  for (const ErrorSourcePtr& source : model.sources) {
    if (source->cause().forms.size() > 1) forms.push_back(source->name());
  }
  return forms;
}

/// Notes that a cause of the cell's own list now has another form.
void note(std::vector<Reformed>& reformed, const std::string& from, const std::string& to) {
  const auto before = std::find_if(reformed.begin(), reformed.end(),
                                   [&](const Reformed& one) { return one.to == from; });
  if (before == reformed.end()) {
    reformed.push_back({from, to});
  } else {
    before->to = to;
  }
}

/// `now` with `other` in place of `form`, starting at its values; empty where the cell cannot have
/// it.
std::optional<PriorModel> with_other_form(const PriorModel& now, const std::string& form,
                                          const std::string& other, const SearchResult& result) {
  const VectorXd values = now.model.values(places_of_source(now.model, form));
  PriorModel changed = now;
  remove_from(changed, form);
  if (!add_to(changed, other)) return std::nullopt;
  const std::vector<Index> places = places_of_source(changed.model, other);
  if (static_cast<Index>(places.size()) == values.size()) changed.model.values(places) = values;
  refine(changed, result.batch, result.unnamed);
  return changed;
}

}  // namespace

Result<bool> add_in_best_form(SearchResult& result, Accepted& one, const Accepted* poorer) {
  const VectorXd weight = weight_of(result.after, result.batch);
  double least = held_out_square(result.after, result.batch, result.unnamed, weight);
  PriorModel start = result.after;
  if (poorer != nullptr) remove_from(start, poorer->in_model);
  std::optional<PriorModel> best;
  for (const std::string& spelling : spellings(one.source, *start.model.cell)) {
    PriorModel extended = start;
    TRY(add_to(extended, spelling));
    refine(extended, result.batch, result.unnamed);
    const double square = held_out_square(extended, result.batch, result.unnamed, weight);
    if (square >= least) continue;
    least = square;
    one.in_model = spelling;
    if (record_of(one.cause).search == causes::SearchFamily::kMap) one.source = spelling;
    best = std::move(extended);
  }
  if (!best) return false;
  result.after = std::move(*best);
  return true;
}

namespace {

bool choose_form_again(SearchResult& result, const std::string& form,
                       const std::vector<std::string>& own_sources) {
  const std::string cause(cause_spelled(form).spelling);
  const bool own_is_open =
      std::find(own_sources.begin(), own_sources.end(), cause) != own_sources.end();
  const auto finding = std::find_if(result.accepted.begin(), result.accepted.end(),
                                    [&](const Accepted& one) { return one.in_model == form; });
  if (finding == result.accepted.end() && !own_is_open) return false;
  const VectorXd weight = weight_of(result.after, result.batch);
  const PriorModel now = result.after;
  double least = held_out_square(now, result.batch, result.unnamed, weight);
  std::string chosen = form;
  for (const std::string& other : alternatives(cause, *now.model.cell)) {
    if (other == form) continue;
    std::optional<PriorModel> changed = with_other_form(now, form, other, result);
    if (!changed) continue;
    const double square = held_out_square(*changed, result.batch, result.unnamed, weight);
    if (square >= least) continue;
    least = square;
    chosen = other;
    result.after = std::move(*changed);
  }
  if (chosen == form) return false;
  if (finding != result.accepted.end()) {
    finding->in_model = chosen;
  } else {
    note(result.reformed, form, chosen);
  }
  return true;
}

}  // namespace

bool choose_forms_again(SearchResult& result, const std::vector<std::string>& own_sources) {
  bool changed = false;
  for (const std::string& form : forms_in(result.after.model)) {
    if (choose_form_again(result, form, own_sources)) changed = true;
  }
  return changed;
}

}  // namespace trammel::cause_search
